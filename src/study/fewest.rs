//! Search for the fewest steps with which a run is accurate enough.
//!
//! The error is not monotonic in the number of steps. Near a change of its sign a longer step may be better than a
//! shorter one. The search therefore combines bisection with further trials:
//!
//! | steps | tried |
//! | --- | --- |
//! | the first `ALL` | every number |
//! | more | doubled until one is enough, then bisected |
//! | from half of the best number to it | `NEIGHBOURS` numbers, evenly spaced; a better one is bisected again |
//!
//! **Invariant:** the returned number of steps was run and was enough, and the number of runs is bounded.

const ALL: u64 = 256;

const NEIGHBOURS: u64 = 16;

/// Most bisections. A usual search needs one or two.
const MOST_BISECTIONS: u32 = 64;

/// A run with any number of steps.
pub trait StepTrial {
    /// Whether the run with this number of steps is accurate enough.
    fn is_enough(&mut self, steps: u64) -> impl Future<Output = bool> + Send;
}

/// A trial without pauses.
impl<F: FnMut(u64) -> bool> StepTrial for F {
    fn is_enough(&mut self, steps: u64) -> impl Future<Output = bool> + Send {
        std::future::ready(self(steps))
    }
}

/// The fewest steps found between `first` and `most`, both included, whose run is accurate enough. `part` is the resolution
/// of the bisection: 64 means to a 64th of the number, `u64::MAX` to a single step.
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
    let (mut too_few, mut next) = ((first - 1).max(ALL), first.max(2 * ALL));
    while best.is_none() && too_few < most {
        next = next.min(most);
        if trial.is_enough(next).await {
            best = Some(next);
        } else {
            (too_few, next) = (next, next.saturating_mul(2));
        }
    }
    // If the largest number fails, a smaller one may still pass.
    let mut end = most.saturating_add(1);
    for _ in 0..MOST_BISECTIONS {
        if let Some(mut enough) = best {
            while enough - too_few > (enough / part.max(1)).max(1) {
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
        let mut next = from.saturating_add(stride);
        loop {
            if next >= end {
                return best;
            }
            if trial.is_enough(next).await {
                break;
            }
            next = next.saturating_add(stride);
        }
        (too_few, best) = (next - stride, Some(next));
    }
    best
}
