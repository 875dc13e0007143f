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

/// A run with any number of steps.
pub trait StepTrial {
    /// Whether the run with this number of steps is good enough.
    fn is_enough(&mut self, steps: u64) -> impl Future<Output = bool> + Send;
}

/// A run that is made at once.
impl<F: FnMut(u64) -> bool> StepTrial for F {
    fn is_enough(&mut self, steps: u64) -> impl Future<Output = bool> + Send {
        std::future::ready(self(steps))
    }
}

/// The fewest steps between `first` and `most`, both included, whose run is good enough. Bisection ends once two
/// numbers are as near as a part of the larger one: 64 means to a 64th, `u64::MAX` to the last step.
pub async fn fewest(first: u64, most: u64, part: u64, mut trial: impl StepTrial) -> Option<u64> {
    let first = first.max(1);
    if first > most {
        return None;
    }
    for steps in first..=ALL.min(most) {
        if trial.is_enough(steps).await {
            return Some(steps);
        }
    }
    let mut best = None;
    let (mut too_few, mut next) = if first <= ALL {
        (ALL, 2 * ALL)
    } else {
        (first - 1, first)
    };
    while best.is_none() && too_few < most {
        next = next.min(most);
        if trial.is_enough(next).await {
            best = Some(next);
        } else {
            (too_few, next) = (next, next.saturating_mul(2));
        }
    }
    // Where the last one fails its neighbours may do.
    let mut end = most.saturating_add(1);
    loop {
        if let Some(mut enough) = best {
            while enough - too_few > (enough / part).max(1) {
                let middle = too_few + (enough - too_few) / 2;
                if trial.is_enough(middle).await {
                    enough = middle;
                } else {
                    too_few = middle;
                }
            }
            (best, end) = (Some(enough), enough);
        }
        let from = (end / 2).max(first).max(ALL + 1);
        let stride = (end.saturating_sub(from) / NEIGHBOURS).max(1);
        let mut next = from + stride;
        loop {
            if next >= end {
                return best;
            }
            if trial.is_enough(next).await {
                break;
            }
            next += stride;
        }
        (too_few, best) = (next - stride, Some(next));
    }
}
