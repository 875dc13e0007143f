//! The goals of one action, their states and their waiting callers. Pure: `R` is a request.
//!
//! **Invariant:** at most [`MAX_GOALS`] are stored. The oldest ended one is removed for a new one.

use std::collections::VecDeque;
use std::time::{SystemTime, UNIX_EPOCH};

use pendularm::protocol::messages::Stamp;
use serde_json::{Value, json};

/// Most stored goals, including ended ones for late requests.
pub const MAX_GOALS: usize = 64;
/// Most requests that wait for the end of one goal.
const MAX_WAITING: usize = 16;
/// Prefix of a goal's id at the arm.
const PREFIX: &str = "ros2-";

/// The states of `action_msgs/msg/GoalStatus` that the arm does not send.
const ACCEPTED: i8 = 1;
const EXECUTING: i8 = 2;
const CANCELING: i8 = 3;

/// The codes of `action_msgs/srv/CancelGoal`.
const DONE: i8 = 0;
const UNKNOWN_GOAL: i8 = 2;
const GOAL_ENDED: i8 = 3;

/// A goal's id.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GoalId([u8; 16]);

/// A goal.
#[derive(Debug)]
pub struct Goal<R> {
    id: GoalId,
    /// The time of its arrival.
    pub stamp: Stamp,
    status: i8,
    /// Its sender, until the arm's first message about it.
    pub asked: Option<R>,
    /// The callers that wait for its end.
    pub waiting: Vec<R>,
    result: Option<Value>,
}

/// The goals, oldest first.
#[derive(Debug)]
pub struct GoalTable<R>(VecDeque<Goal<R>>);

impl<R> Default for GoalTable<R> {
    fn default() -> Self {
        Self(VecDeque::new())
    }
}

impl GoalId {
    /// The member `goal_id` of a message.
    #[must_use]
    pub fn read(message: &Value) -> Option<Self> {
        let numbers = message.pointer("/goal_id/uuid")?.as_array()?;
        let byte = |number: &Value| number.as_u64().and_then(|number| u8::try_from(number).ok());
        let bytes: Vec<u8> = numbers.iter().map(byte).collect::<Option<_>>()?;
        bytes.try_into().ok().map(Self)
    }

    /// The same as a member of a message.
    #[must_use]
    pub fn json(self) -> Value {
        json!({"uuid": self.0})
    }

    /// The id of the goal at the arm.
    #[must_use]
    pub fn text(self) -> String {
        format!("{PREFIX}{:032x}", u128::from_be_bytes(self.0))
    }

    /// The goal with that id at the arm.
    #[must_use]
    pub fn of_text(text: &str) -> Option<Self> {
        let number = u128::from_str_radix(text.strip_prefix(PREFIX)?, 16).ok()?;
        Some(Self(number.to_be_bytes()))
    }

    fn is_zero(self) -> bool {
        self.0 == [0; 16]
    }
}

/// The present time.
#[must_use]
pub fn now() -> Stamp {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    Stamp {
        sec: i32::try_from(since.as_secs()).unwrap_or(i32::MAX),
        nanosec: since.subsec_nanos(),
    }
}

/// The member `stamp` of a message.
#[must_use]
pub fn read_stamp(message: &Value) -> Stamp {
    let part = |place: &str| message.pointer(place).and_then(Value::as_i64);
    let sec = part("/stamp/sec").and_then(|sec| i32::try_from(sec).ok());
    let nanosec = part("/stamp/nanosec").and_then(|nanosec| u32::try_from(nanosec).ok());
    Stamp {
        sec: sec.unwrap_or_default(),
        nanosec: nanosec.unwrap_or_default(),
    }
}

impl<R> GoalTable<R> {
    fn get(&mut self, id: GoalId) -> Option<&mut Goal<R>> {
        self.0.iter_mut().find(|goal| goal.id == id)
    }

    /// Adds a goal. Returns its request if it cannot be added.
    ///
    /// # Errors
    /// If there is a goal with that id, or no space for another.
    pub fn begin(&mut self, id: GoalId, asked: R) -> Result<(), R> {
        if self.get(id).is_some() {
            return Err(asked);
        }
        if self.0.len() >= MAX_GOALS {
            let ended = self.0.iter().position(|goal| goal.result.is_some());
            match ended {
                Some(at) => drop(self.0.remove(at)),
                None => return Err(asked),
            }
        }
        self.0.push_back(Goal {
            id,
            stamp: now(),
            status: ACCEPTED,
            asked: Some(asked),
            waiting: Vec::new(),
            result: None,
        });
        Ok(())
    }

    /// The arm has accepted it. Returns its sender, once.
    pub fn accept(&mut self, id: GoalId) -> Option<(R, Stamp)> {
        let goal = self.get(id)?;
        let asked = goal.asked.take()?;
        goal.status = EXECUTING;
        Some((asked, goal.stamp))
    }

    /// The arm never accepted it.
    pub fn remove(&mut self, id: GoalId) -> Option<Goal<R>> {
        let at = self.0.iter().position(|goal| goal.id == id)?;
        self.0.remove(at)
    }

    /// It has ended. Returns the callers that wait for the end.
    pub fn end(&mut self, id: GoalId, status: i8, result: Value) -> Vec<R> {
        let Some(goal) = self.get(id) else {
            return Vec::new();
        };
        goal.status = status;
        goal.result = Some(result);
        std::mem::take(&mut goal.waiting)
    }

    /// Adds a caller that waits for its end.
    ///
    /// # Errors
    /// The request, if it does not have to wait: with the result, or with `None` if there is no such goal or no space.
    pub fn wait(&mut self, id: GoalId, request: R) -> Result<(), (R, Option<&Value>)> {
        match self.0.iter_mut().find(|goal| goal.id == id) {
            None => Err((request, None)),
            Some(goal) if goal.result.is_some() => Err((request, goal.result.as_ref())),
            Some(goal) if goal.waiting.len() >= MAX_WAITING => Err((request, None)),
            Some(goal) => {
                goal.waiting.push(request);
                Ok(())
            }
        }
    }

    /// The goals of a cancel request, and its code. Without an id it is for all goals up to a time, and without a time
    /// for all.
    pub fn cancel(&mut self, id: GoalId, until: Stamp) -> (i8, Vec<GoalId>) {
        if !id.is_zero() && self.get(id).is_none() {
            return (UNKNOWN_GOAL, Vec::new());
        }
        let is_meant = |goal: &Goal<R>| {
            let in_time = goal.stamp <= until || (id.is_zero() && until == Stamp::default());
            goal.id == id || (in_time && (id.is_zero() || until != Stamp::default()))
        };
        let meant = self.0.iter_mut().filter(|goal| is_meant(goal));
        let running: Vec<_> = meant.filter(|goal| goal.result.is_none()).collect();
        if running.is_empty() && !id.is_zero() {
            return (GOAL_ENDED, Vec::new());
        }
        let cancelled = running.into_iter().map(|goal| {
            goal.status = CANCELING;
            goal.id
        });
        (DONE, cancelled.collect())
    }

    /// A goal as `action_msgs/msg/GoalInfo`.
    pub fn info(&mut self, id: GoalId) -> Value {
        let stamp = self.get(id).map(|goal| goal.stamp).unwrap_or_default();
        json!({"goal_id": id.json(), "stamp": stamp})
    }

    /// All as `action_msgs/msg/GoalStatusArray`, except goals without a message from the arm.
    #[must_use]
    pub fn status(&self) -> Value {
        let known = self.0.iter().filter(|goal| goal.asked.is_none());
        let list: Vec<Value> = known
            .map(|goal| {
                let info = json!({"goal_id": goal.id.json(), "stamp": goal.stamp});
                json!({"goal_info": info, "status": goal.status})
            })
            .collect();
        json!({"status_list": list})
    }

    /// All waiting callers.
    pub fn drain(&mut self) -> Vec<R> {
        let goals = self.0.drain(..);
        goals
            .flat_map(|goal| goal.asked.into_iter().chain(goal.waiting))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(number: u8) -> GoalId {
        GoalId([number; 16])
    }

    fn running(count: u8) -> GoalTable<u8> {
        let mut goals = GoalTable::default();
        for number in 1..=count {
            goals.begin(id(number), number).unwrap();
            goals.accept(id(number)).unwrap();
        }
        goals
    }

    #[test]
    fn an_id_is_the_same_in_messages_and_at_the_arm() {
        let one = GoalId([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 255]);
        assert_eq!(GoalId::of_text(&one.text()), Some(one));
        assert_eq!(GoalId::read(&json!({"goal_id": one.json()})), Some(one));
        assert_eq!(GoalId::of_text("trial-1"), None);
        assert_eq!(GoalId::read(&json!({"goal_id": {"uuid": [1]}})), None);
    }

    #[test]
    fn a_goal_is_accepted_once_and_its_end_is_sent_to_all_waiting_clients() {
        let mut goals = GoalTable::default();
        goals.begin(id(1), 'a').unwrap();
        assert_eq!(goals.begin(id(1), 'b'), Err('b'), "that id is taken");
        assert_eq!(goals.status(), json!({"status_list": []}), "not yet");
        assert_eq!(goals.accept(id(1)).unwrap().0, 'a');
        assert_eq!(goals.accept(id(1)), None);
        goals.wait(id(1), 'c').unwrap();
        goals.wait(id(1), 'd').unwrap();
        assert_eq!(goals.end(id(1), 4, json!("done")), ['c', 'd']);
        assert_eq!(goals.wait(id(1), 'e'), Err(('e', Some(&json!("done")))));
        assert_eq!(goals.wait(id(2), 'f'), Err(('f', None)));
        assert_eq!(goals.status()["status_list"][0]["status"], 4);
    }

    #[test]
    fn cancelling_means_one_goal_or_all_or_all_up_to_a_time() {
        let mut goals = running(3);
        let never = Stamp::default();
        assert_eq!(goals.cancel(id(2), never), (DONE, vec![id(2)]));
        assert_eq!(goals.cancel(id(9), never), (UNKNOWN_GOAL, vec![]));
        goals.end(id(1), 4, json!({}));
        assert_eq!(goals.cancel(id(1), never), (GOAL_ENDED, vec![]));
        assert_eq!(goals.cancel(id(0), never), (DONE, vec![id(2), id(3)]));
        let early = Stamp { sec: 1, nanosec: 0 };
        assert_eq!(goals.cancel(id(0), early), (DONE, vec![]));
        assert_eq!(goals.cancel(id(0), now()), (DONE, vec![id(2), id(3)]));
        assert_eq!(goals.status()["status_list"][1]["status"], CANCELING);
    }

    #[test]
    fn the_oldest_that_has_ended_makes_room() {
        let count = u8::try_from(MAX_GOALS).unwrap();
        let mut goals = running(count);
        assert_eq!(goals.begin(id(200), 200), Err(200), "all are running");
        goals.end(id(3), 4, json!({}));
        goals.begin(id(200), 200).unwrap();
        assert_eq!(goals.0.len(), MAX_GOALS);
        assert!(goals.get(id(3)).is_none());
    }

    #[test]
    fn no_waiting_call_is_lost_when_the_arm_disconnects() {
        let mut goals = running(1);
        goals.begin(id(2), 20).unwrap();
        goals.wait(id(1), 10).unwrap();
        assert_eq!(goals.drain(), [10, 20]);
    }
}
