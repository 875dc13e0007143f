//! `tf2_web_republisher`: frames for web viewers that cannot combine chains of frames.
//!
//! The service returns the name of a topic that has every frame relative to the world. A client can also send a goal,
//! by the action or by the topics of a ROS 1 action (as roslib 1 does). It then gets the requested frames as
//! feedback, relative to the requested frame, at its rate.
//!
//! A request ends with its connection. A published one also ends when that connection unsubscribes from the feedback.
//!
//! **Invariant:** nothing is requested from the arm without a request and a subscriber. A connection has
//! at most [`MAX_FRAME_SUBSCRIPTIONS`] requests.

mod wire;

use std::collections::VecDeque;
use std::sync::Weak;
use std::time::Duration;

use actix::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};
use tokio::time::Instant;

use crate::actors::ConnectionId;
use crate::actors::arm::sim::{ArmPose, Pose};
use crate::actors::node::{
    ActionClient, Ask, Call, CancelSent, ForwardGoal, Interest, Publish, ShutDown,
};
use crate::protocol::catalog::Topic;
use crate::protocol::messages::scene::{TfMessage, WORLD, frames, seen_from};
use crate::protocol::messages::{Empty, Header, Stamp};
use crate::protocol::op::GoalStatus;

/// Most requests of one connection. The oldest one ends when another arrives.
pub const MAX_FRAME_SUBSCRIPTIONS: usize = 4;
/// Most frames of one request.
pub const MAX_FRAMES: usize = 32;
/// Time between two requests to the arm, and so the shortest time between two messages.
const PERIOD: Duration = Duration::from_micros(16_667);
/// Time between two messages of the topic.
const TOPIC_PERIOD: Duration = Duration::from_millis(33);
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

impl Ask for RepublishTfs {
    type Answer = ();
}

/// The requested frames of an arm of `N` links.
pub struct FrameGoal<const N: usize> {
    /// The frames.
    pub sources: Vec<String>,
    /// The frame to which they are relative.
    pub target: String,
    /// Time between two messages.
    pub period: Duration,
}

/// Sends frames until cancelled. From clients, by the topic.
#[derive(Message)]
#[rtype(result = "()")]
pub struct SubscribeFrames<const N: usize> {
    /// The frames.
    pub goal: FrameGoal<N>,
    /// The receiver of the frames.
    pub by: FrameReceiver,
}

/// A receiver of frames.
pub enum FrameReceiver {
    /// A client with a goal of the action.
    Client(Box<ActionClient>),
    /// A client with a published goal.
    Topic {
        /// The goal's id.
        id: String,
        /// The client.
        connection: ConnectionId,
        /// Ends when the client no longer listens.
        listening: Weak<()>,
    },
}

/// Cancels the published goal with that id, or all of them. From clients, by the topic.
#[derive(Message)]
#[rtype(result = "()")]
pub struct UnsubscribeFrames(pub Option<String>);

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `tf2_web_republisher` for an arm of `N` links.
pub struct TfRepublisher<const N: usize> {
    arm: Recipient<ArmPose<N>>,
    publish: Recipient<Publish>,
    /// Oldest first.
    subscriptions: VecDeque<(SubscribeFrames<N>, Instant)>,
    /// When the topic is due next, while it has subscribers.
    topic: Option<Instant>,
    timer: Option<SpawnHandle>,
}

impl<const N: usize> TfRepublisher<N> {
    /// A node without requests.
    #[must_use]
    pub const fn new(arm: Recipient<ArmPose<N>>, publish: Recipient<Publish>) -> Self {
        Self {
            arm,
            publish,
            subscriptions: VecDeque::new(),
            topic: None,
            timer: None,
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

impl<const N: usize> Handler<SubscribeFrames<N>> for TfRepublisher<N> {
    type Result = ();

    fn handle(&mut self, subscription: SubscribeFrames<N>, ctx: &mut Context<Self>) {
        self.forget_gone();
        let client = subscription.client();
        let all = self.subscriptions.iter().enumerate();
        let own = all.filter(|(_, (one, _))| one.client() == client);
        let own: Vec<usize> = own.map(|(at, _)| at).collect();
        if let [oldest, ..] = own[..]
            && own.len() >= MAX_FRAME_SUBSCRIPTIONS
            && let Some((oldest, _)) = self.subscriptions.remove(oldest)
        {
            oldest.end(GoalStatus::Aborted, Some(TOO_MANY));
        }
        self.subscriptions.push_back((subscription, Instant::now()));
        self.keep_timer(ctx);
    }
}

impl<const N: usize> Handler<ForwardGoal<FrameGoal<N>>> for TfRepublisher<N> {
    type Result = ();

    fn handle(&mut self, forwarded: ForwardGoal<FrameGoal<N>>, ctx: &mut Context<Self>) {
        let ForwardGoal { goal, client, .. } = forwarded;
        let by = FrameReceiver::Client(Box::new(client));
        self.handle(SubscribeFrames { goal, by }, ctx);
    }
}

impl<const N: usize> Handler<CancelSent> for TfRepublisher<N> {
    type Result = ();

    fn handle(&mut self, cancel: CancelSent, ctx: &mut Context<Self>) {
        let is_meant = |subscription: &SubscribeFrames<N>| match &subscription.by {
            FrameReceiver::Client(client) => cancel.is_of(client),
            FrameReceiver::Topic { .. } => false,
        };
        loop {
            let mut all = self.subscriptions.iter();
            let at = all.position(|(subscription, _)| is_meant(subscription));
            match at.and_then(|at| self.subscriptions.remove(at)) {
                Some((subscription, _)) => subscription.end(GoalStatus::Canceled, None),
                None => break cancel.refuse(NOT_KEPT),
            }
            if !cancel.all {
                break;
            }
        }
        self.keep_timer(ctx);
    }
}

impl<const N: usize> Handler<UnsubscribeFrames> for TfRepublisher<N> {
    type Result = ();

    fn handle(&mut self, UnsubscribeFrames(id): UnsubscribeFrames, ctx: &mut Context<Self>) {
        self.subscriptions
            .retain(|(subscription, _)| match &subscription.by {
                FrameReceiver::Client(_) => true,
                FrameReceiver::Topic { id: own, .. } => id.as_ref().is_some_and(|id| id != own),
            });
        self.keep_timer(ctx);
    }
}

impl<const N: usize> Handler<Interest> for TfRepublisher<N> {
    type Result = ();

    fn handle(&mut self, interest: Interest, ctx: &mut Context<Self>) {
        if interest.topic == Topic::TfWeb {
            self.topic = interest.wanted.then(Instant::now);
        }
        self.keep_timer(ctx);
    }
}

impl<const N: usize> Handler<ShutDown> for TfRepublisher<N> {
    type Result = ();

    fn handle(&mut self, _: ShutDown, ctx: &mut Context<Self>) {
        for (subscription, _) in self.subscriptions.drain(..) {
            subscription.end(GoalStatus::Aborted, None);
        }
        self.keep_timer(ctx);
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> SubscribeFrames<N> {
    /// Informs a client with a goal of the action of its end, and of the reason if it has no result.
    fn end(&self, status: GoalStatus, why: Option<&str>) {
        let FrameReceiver::Client(client) = &self.by else {
            return;
        };
        match why {
            Some(why) => client.fail(why, status),
            None => client.conclude(Empty {}, status),
        }
    }

    fn client(&self) -> ConnectionId {
        match &self.by {
            FrameReceiver::Client(client) => client.link.connection,
            FrameReceiver::Topic { connection, .. } => *connection,
        }
    }

    fn is_gone(&self) -> bool {
        match &self.by {
            FrameReceiver::Client(client) => client.link.is_gone(),
            FrameReceiver::Topic { listening, .. } => listening.strong_count() == 0,
        }
    }
}

impl<const N: usize> TfRepublisher<N> {
    fn forget_gone(&mut self) {
        self.subscriptions
            .retain(|(subscription, _)| !subscription.is_gone());
    }

    /// Runs a timer only while there are requests or subscribers.
    fn keep_timer(&mut self, ctx: &mut Context<Self>) {
        let is_wanted = self.topic.is_some() || !self.subscriptions.is_empty();
        match self.timer {
            None if is_wanted => self.timer = Some(ctx.run_interval(PERIOD, Self::send_on_timer)),
            Some(timer) if !is_wanted => {
                ctx.cancel_future(timer);
                self.timer = None;
            }
            _ => {}
        }
    }

    /// Requests the arm's pose, and sends the due messages.
    fn send_on_timer(&mut self, ctx: &mut Context<Self>) {
        self.forget_gone();
        self.keep_timer(ctx);
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
        let seen = |target: &str, sources: &[String]| {
            let sources = sources.iter().map(String::as_str);
            seen_from(stamp, target, sources, &pose.lengths, &pose.state.position)
        };
        // A message is sent at the nearest tick: the next tick would be later than this one is early.
        let latest = now + PERIOD / 2;
        if let Some(due) = self.topic.as_mut().filter(|due| **due <= latest) {
            *due = next_due(*due, TOPIC_PERIOD, now);
            publish(&self.publish, Topic::TfWeb, seen(WORLD, &frames(N)));
        }
        let mut due: Vec<_> = self
            .subscriptions
            .iter_mut()
            .filter(|(_, due)| *due <= latest)
            .collect();
        // The longest overdue are first.
        due.sort_by_key(|(_, due)| *due);
        for (order, (subscription, due)) in (0..).zip(due.into_iter().take(AT_ONCE)) {
            // A nanosecond keeps the order, so requests that are always due take turns.
            let sent = now + Duration::from_nanos(order);
            *due = next_due(*due, subscription.goal.period, sent);
            let message = seen(&subscription.goal.target, &subscription.goal.sources);
            match &subscription.by {
                FrameReceiver::Client(client) => client.feed_back(message),
                FrameReceiver::Topic { id, .. } => {
                    let message = published(stamp, id, &message);
                    publish(&self.publish, Topic::TfWebFeedback, message);
                }
            }
        }
    }
}

/// The next due time of a message that was due at `due` and is sent `now`. A delay of up to a period is made up.
fn next_due(due: Instant, period: Duration, now: Instant) -> Instant {
    (due + period).max(now)
}

/// A `tf2_web_republisher/TFSubscriptionActionFeedback` under the id of the request. The status 1 is `active` in ROS 1.
fn published(stamp: Stamp, id: &str, feedback: &TfMessage) -> Value {
    json!({
        "header": Header { stamp, frame_id: "" },
        "status": {"goal_id": {"stamp": stamp, "id": id}, "status": 1, "text": ""},
        "feedback": feedback,
    })
}

fn publish(to: &Recipient<Publish>, topic: Topic, message: impl Serialize + Send + 'static) {
    to.do_send(Publish::made(topic, move || message));
}
