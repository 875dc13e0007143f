//! `tf2_web_republisher`: frames for web viewers that cannot combine chains of frames.
//!
//! The service returns the name of the arm's topic that has every frame relative to the world. A client can also send a
//! goal, by the action or by the topics of a ROS 1 action (as roslib 1 does). It then gets the requested frames as
//! feedback, relative to the requested frame, at its rate.
//!
//! A request ends with its connection. A published one also ends when that connection unsubscribes from the feedback.
//!
//! **Invariant:** nothing is requested from the arm without a request. A connection has at most
//! [`MAX_FRAME_SUBSCRIPTIONS`] requests.

mod wire;

use std::sync::Weak;
use std::time::Duration;

use actix::prelude::*;
use serde_json::{Value, json};
use tokio::time::Instant;

use crate::actors::arm::sim::{ArmPose, Pose};
use crate::actors::node::{ActionClient, Call, CancelSent, ForwardGoal, Publish, ShutDown};
use crate::protocol::catalog::Topic;
use crate::protocol::messages::scene::{TfMessage, seen_from};
use crate::protocol::messages::{Empty, Header, Stamp};
use crate::protocol::op::GoalStatus;

pub use self::wire::attach;

/// Most requests of one connection. The oldest one ends when another arrives.
pub const MAX_FRAME_SUBSCRIPTIONS: usize = 4;
/// Most frames of one request.
pub const MAX_FRAMES: usize = 32;
/// Time between two requests to the arm, and so the shortest time between two messages.
const PERIOD: Duration = Duration::from_micros(16_667);
/// Most messages of all goals per tick, at 60 ticks a second. A message takes up to 30 us of the gateway's
/// thread, and a published one is sent to all subscribers.
const AT_ONCE: usize = 5;

/// The reason of an evicted request.
const TOO_MANY: &str = "this client has too many goals, so its oldest one ends";
/// The error for a client that cancels an unknown or ended request.
const NOT_KEPT: &str = "id must be that of a goal of this connection";

// ---- messages -------------------------------------------------------------------------------------------------------

/// Requests the name of the topic with the frames. From clients, by `/republish_tfs`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RepublishTfs;

/// A client's request for frames of an arm of `N` links.
pub struct FrameGoal<const N: usize> {
    /// The frames.
    pub sources: Vec<String>,
    /// The frame to which they are relative.
    pub target: String,
    /// Time between two messages.
    pub period: Duration,
    /// `None` for a goal of the action.
    pub published: Option<PublishedGoal>,
}

/// A goal that a client has published.
pub struct PublishedGoal {
    /// Its id, which its feedback has too.
    pub id: String,
    /// Ends when the client no longer listens to the feedback.
    pub listening: Weak<()>,
}

/// Ends the published goals with that id, or all of them. From clients, by the topic.
#[derive(Message)]
#[rtype(result = "()")]
pub struct CancelPublished(pub Option<String>);

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `tf2_web_republisher` for an arm of `N` links.
pub struct TfRepublisher<const N: usize> {
    arm: Recipient<ArmPose<N>>,
    publish: Recipient<Publish>,
    /// Oldest first.
    requests: Vec<FrameRequest<N>>,
    timer: Option<SpawnHandle>,
}

struct FrameRequest<const N: usize> {
    goal: FrameGoal<N>,
    client: ActionClient,
    /// When its next message is due.
    due: Instant,
}

impl<const N: usize> TfRepublisher<N> {
    /// A node without requests.
    #[must_use]
    pub const fn new(arm: Recipient<ArmPose<N>>, publish: Recipient<Publish>) -> Self {
        Self {
            arm,
            publish,
            requests: Vec::new(),
            timer: None,
        }
    }

    fn end_those(&mut self, status: GoalStatus, is_meant: impl Fn(&FrameRequest<N>) -> bool) {
        for request in self.requests.extract_if(.., |request| is_meant(request)) {
            request.end(status, None);
        }
    }

    /// Requests the arm's pose, and sends the due messages. Stops when there are no requests.
    fn send_on_timer(&mut self, ctx: &mut Context<Self>) {
        self.requests.retain(|request| !request.is_gone());
        if self.requests.is_empty() {
            if let Some(timer) = self.timer.take() {
                ctx.cancel_future(timer);
            }
            return;
        }
        let asked = self.arm.send(ArmPose).into_actor(self);
        ctx.wait(asked.map(|pose, node, _| {
            if let Ok(pose) = pose {
                node.send_due(&pose);
            }
        }));
    }

    /// Sends the messages that are due at this pose of the arm.
    fn send_due(&mut self, pose: &Pose<N>) {
        let (now, stamp) = (Instant::now(), Stamp::from_seconds(pose.time));
        // A message is sent at the nearest tick: the next tick would be later than this one is early.
        let latest = now + PERIOD / 2;
        let due = self
            .requests
            .iter_mut()
            .filter(|request| request.due <= latest);
        let mut due: Vec<_> = due.collect();
        // The longest overdue are first.
        due.sort_by_key(|request| request.due);
        for (order, FrameRequest { goal, client, due }) in (0..).zip(due.into_iter().take(AT_ONCE))
        {
            // A delay of up to a period is made up. A nanosecond keeps the order, so requests that are always due take turns.
            *due = (*due + goal.period).max(now + Duration::from_nanos(order));
            let sources = goal.sources.iter().map(String::as_str);
            let (lengths, positions) = (&pose.lengths, &pose.state.position);
            let message = seen_from(stamp, &goal.target, sources, lengths, positions);
            if let Some(PublishedGoal { id, .. }) = &goal.published {
                let message = published(stamp, id, &message);
                self.publish
                    .do_send(Publish::made(Topic::TfWebFeedback, move || message));
            } else {
                client.feed_back(message);
            }
        }
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for TfRepublisher<N> {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<Call<RepublishTfs>> for TfRepublisher<N> {
    type Result = ();

    fn handle(&mut self, mut call: Call<RepublishTfs>, _: &mut Context<Self>) {
        call.reply.answer(());
    }
}

impl<const N: usize> Handler<ForwardGoal<FrameGoal<N>>> for TfRepublisher<N> {
    type Result = ();

    fn handle(&mut self, forwarded: ForwardGoal<FrameGoal<N>>, ctx: &mut Context<Self>) {
        let ForwardGoal { goal, client, .. } = forwarded;
        self.requests.retain(|request| !request.is_gone());
        let is_own =
            |request: &FrameRequest<N>| request.client.link.connection == client.link.connection;
        let own = self.requests.iter().filter(|request| is_own(request));
        if own.count() >= MAX_FRAME_SUBSCRIPTIONS
            && let Some(oldest) = self.requests.iter().position(is_own)
        {
            self.requests
                .remove(oldest)
                .end(GoalStatus::Aborted, Some(TOO_MANY));
        }
        let due = Instant::now();
        self.requests.push(FrameRequest { goal, client, due });
        self.timer
            .get_or_insert_with(|| ctx.run_interval(PERIOD, Self::send_on_timer));
    }
}

impl<const N: usize> Handler<CancelSent> for TfRepublisher<N> {
    type Result = ();

    fn handle(&mut self, cancel: CancelSent, _: &mut Context<Self>) {
        let before = self.requests.len();
        self.end_those(
            GoalStatus::Canceled,
            |FrameRequest { goal, client, .. }| goal.published.is_none() && cancel.is_of(client),
        );
        if self.requests.len() == before {
            cancel.refuse(NOT_KEPT);
        }
    }
}

impl<const N: usize> Handler<CancelPublished> for TfRepublisher<N> {
    type Result = ();

    fn handle(&mut self, CancelPublished(id): CancelPublished, _: &mut Context<Self>) {
        let is_meant = |published: &PublishedGoal| id.as_ref().is_none_or(|id| *id == published.id);
        self.end_those(GoalStatus::Canceled, |request| {
            request.goal.published.as_ref().is_some_and(is_meant)
        });
    }
}

impl<const N: usize> Handler<ShutDown> for TfRepublisher<N> {
    type Result = ();

    fn handle(&mut self, _: ShutDown, _: &mut Context<Self>) {
        self.end_those(GoalStatus::Aborted, |_| true);
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> FrameRequest<N> {
    /// Informs the client of the end, and of the reason if there is no result. A published goal ends silently.
    fn end(&self, status: GoalStatus, why: Option<&str>) {
        if self.goal.published.is_some() {
            return;
        }
        match why {
            Some(why) => self.client.fail(why, status),
            None => self.client.conclude(Empty {}, status),
        }
    }

    fn is_gone(&self) -> bool {
        match &self.goal.published {
            Some(published) => published.listening.strong_count() == 0,
            None => self.client.link.is_gone(),
        }
    }
}

/// A `tf2_web_republisher/TFSubscriptionActionFeedback` under the id of the request. The status 1 is `active` in ROS 1.
fn published(stamp: Stamp, id: &str, feedback: &TfMessage) -> Value {
    json!({
        "header": Header { stamp, frame_id: "" },
        "status": {"goal_id": {"stamp": stamp, "id": id}, "status": 1, "text": ""},
        "feedback": feedback,
    })
}
