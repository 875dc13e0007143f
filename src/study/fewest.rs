//! The fewest steps with which a run is good enough.
//!
//! An error need not fall with every step more: where it changes its sign a longer step may be better than a shorter
//! one. So the search does not trust bisection alone:
//!
//! | steps | tried |
//! | --- | --- |
//! | the first `ALL` | every number |
//! | more | doubled until one is enough, then bisected |
//! | between half of what was found and it | `NEIGHBOURS` numbers, evenly spaced; a better one is bisected again |
//!
//! **Invariant:** the number that is returned has been run and was enough, and the number of runs is bounded.

/// Numbers of steps that are all tried.
const ALL: u64 = 256;

/// Runs between half of what was found and it.
const NEIGHBOURS: u64 = 16;

/// A search that asks for one run after another: [`StepSearch::wanted`] says how many steps, [`StepSearch::tell`] takes
/// whether they were enough.
#[derive(Debug, Clone, Copy)]
pub struct StepSearch {
    fewest: u64,
    most: u64,
    /// Once two numbers are as near as this part of the larger one, bisection ends.
    resolution: u64,
    best: Option<u64>,
    stage: Stage,
}

#[derive(Debug, Clone, Copy)]
enum Stage {
    /// One more each time, up to a last one.
    Counting(u64, u64),
    /// Twice as many each time; the number before was too few.
    Doubling {
        too_few: u64,
        next: u64,
    },
    /// Between one that was too few and one that was enough.
    Halving {
        too_few: u64,
        enough: u64,
    },
    /// Evenly spaced between the number and the end; the number before was too few.
    Looking {
        next: u64,
        end: u64,
        stride: u64,
    },
    Done,
}

impl StepSearch {
    /// A search between these numbers of steps, both included, to the last step.
    #[must_use]
    pub fn new(fewest: u64, most: u64) -> Self {
        let fewest = fewest.max(1);
        Self {
            fewest,
            most,
            resolution: u64::MAX,
            best: None,
            stage: if fewest > most {
                Stage::Done
            } else if fewest < ALL {
                Stage::Counting(fewest, ALL.min(most))
            } else {
                Stage::Doubling {
                    too_few: fewest - 1,
                    next: fewest,
                }
            },
        }
    }

    /// The same search to a part of the steps: 64 means to a 64th.
    #[must_use]
    pub fn to_part(self, resolution: u64) -> Self {
        Self { resolution, ..self }
    }

    /// The number of steps of the next run; none once the search is over.
    #[must_use]
    pub fn wanted(&self) -> Option<u64> {
        match self.stage {
            Stage::Counting(next, _)
            | Stage::Doubling { next, .. }
            | Stage::Looking { next, .. } => Some(next),
            Stage::Halving { too_few, enough } => Some(too_few + (enough - too_few) / 2),
            Stage::Done => None,
        }
    }

    /// Takes whether the run that was asked for was good enough.
    pub fn tell(&mut self, is_enough: bool) {
        let Some(steps) = self.wanted() else {
            return;
        };
        if is_enough {
            self.best = Some(steps);
        }
        self.stage = match self.stage {
            Stage::Counting(..) if is_enough => Stage::Done,
            Stage::Counting(_, last) if steps < last => Stage::Counting(steps + 1, last),
            Stage::Doubling { too_few, .. } if is_enough => self.halving(too_few, steps),
            Stage::Counting(..) | Stage::Doubling { .. } => self.doubling(steps),
            Stage::Halving { too_few, .. } if is_enough => self.halving(too_few, steps),
            Stage::Halving { enough, .. } => self.halving(steps, enough),
            Stage::Looking { stride, .. } if is_enough => self.halving(steps - stride, steps),
            Stage::Looking { end, stride, .. } => self.look_on(steps + stride, end, stride),
            Stage::Done => Stage::Done,
        };
    }

    /// The fewest steps that were enough, so far.
    #[must_use]
    pub fn best(&self) -> Option<u64> {
        self.best
    }

    fn doubling(&self, too_few: u64) -> Stage {
        if too_few < self.most {
            let next = too_few.saturating_mul(2).min(self.most);
            Stage::Doubling { too_few, next }
        } else {
            // One step more than may be taken: its neighbours may do.
            self.look_below(self.most.saturating_add(1))
        }
    }

    fn halving(&self, too_few: u64, enough: u64) -> Stage {
        let near = (enough / self.resolution).max(1);
        if enough - too_few > near {
            Stage::Halving { too_few, enough }
        } else {
            self.look_below(enough)
        }
    }

    fn look_below(&self, end: u64) -> Stage {
        let from = (end / 2).max(self.fewest).max(ALL + 1);
        let stride = (end.saturating_sub(from) / NEIGHBOURS).max(1);
        self.look_on(from + stride, end, stride)
    }

    fn look_on(&self, next: u64, end: u64, stride: u64) -> Stage {
        if next < end {
            Stage::Looking { next, end, stride }
        } else {
            Stage::Done
        }
    }
}

#[cfg(test)]
mod tests {
    use super::StepSearch;

    fn found(mut search: StepSearch, is_enough: impl Fn(u64) -> bool) -> (Option<u64>, u32) {
        let mut runs = 0;
        while let Some(steps) = search.wanted() {
            search.tell(is_enough(steps));
            runs += 1;
        }
        (search.best(), runs)
    }

    #[test]
    fn the_fewest_are_found_wherever_they_are() {
        for fewest in [
            1, 2, 69, 255, 256, 257, 258, 1000, 4097, 3_999_999, 4_000_000,
        ] {
            let (best, runs) = found(StepSearch::new(1, 4_000_000), |steps| steps >= fewest);
            assert_eq!(best, Some(fewest));
            assert!(runs < 320, "{runs}");
        }
        for fewest in [800, 900, 4000] {
            let (best, _) = found(StepSearch::new(700, 4000), |steps| steps >= fewest);
            assert_eq!(best, Some(fewest));
        }
    }

    #[test]
    fn a_lucky_stretch_below_is_found() {
        // 69 to 77 are enough, 78 to 110 are not.
        let (best, _) = found(StepSearch::new(1, 1 << 20), |steps| {
            steps >= 111 || (69..78).contains(&steps)
        });
        assert_eq!(best, Some(69));
        let (best, _) = found(StepSearch::new(1, 1 << 20), |steps| {
            steps >= 11_100 || (6900..7800).contains(&steps)
        });
        assert_eq!(best, Some(6900));
    }

    /// The last number that may be taken fails, but not one before it.
    #[test]
    fn the_end_of_what_may_be_taken_hides_nothing() {
        let (best, _) = found(StepSearch::new(1, 9000), |steps| {
            (6900..7800).contains(&steps)
        });
        assert_eq!(best, Some(6900));
    }

    #[test]
    fn nothing_is_found_where_nothing_is_enough() {
        assert_eq!(found(StepSearch::new(1, 1000), |_| false).0, None);
        assert_eq!(found(StepSearch::new(11, 10), |_| true), (None, 0));
    }

    #[test]
    fn a_coarse_search_takes_fewer_runs() {
        let enough = |steps| steps >= 300_000;
        let (best, runs) = found(StepSearch::new(300, 1 << 20).to_part(64), enough);
        let best = best.unwrap();
        assert!((300_000..305_000).contains(&best), "{best}");
        assert!(runs < 40, "{runs}");
    }
}
