//! `tf2_web_republisher`: frames as web viewers want them, which can't put chains of frames together.
//!
//! A client that asks by the service gets the name of a topic, on which every frame comes as seen from the world. A
//! client sends a goal, by the action or by the topics of ROS 1's actions (as roslib 1 does). It gets the frames that
//! it names as feedback, seen from the frame that it names, at its rate.
//!
//! A wish belongs to its connection and ends with it. A published one also ends when that connection unsubscribes from
//! the feedback.
//!
//! **Invariant:** the arm is not asked while there is no wish and no subscriber. A connection has at most
//! [`MAX_WISHES`] wishes.

mod answers;
mod wire;

use std::collections::VecDeque;
use std::sync::Weak;
use std::time::Duration;

use actix::prelude::*;
use serde::Serialize;
use tokio::time::Instant;

use crate::actors::ConnectionId;
use crate::actors::arm::sim::{ArmPose, Pose};
use crate::actors::node::{Ask, Call, Interest, Publish, ShutDown};
use crate::actors::wire::action_client::{ActionClient, Canceller};
use crate::protocol::catalog::Topic;
use crate::protocol::messages::republished::{frames, seen_from};
use crate::protocol::messages::scene::WORLD;
use crate::protocol::messages::{Empty, Stamp};
use crate::protocol::op::GoalStatus;

/// Wishes for frames of one connection; the oldest one ends when another comes.
pub const MAX_WISHES: usize = 4;
/// Frames that one wish may name.
pub const MAX_FRAMES: usize = 32;
/// Time between two looks at the arm, and so the shortest between two messages.
const PERIOD: Duration = Duration::from_micros(16_667);
/// Time between two messages of the topic.
const TOPIC_PERIOD: Duration = Duration::from_millis(33);
/// Messages of all goals in one look, of which 60 come in a second. A message takes up to 30 us of the gateway's
/// thread, and one that is published goes to all subscribers.
const AT_ONCE: usize = 5;

/// The end of a wish when its connection has too many.
const TOO_MANY: &str = "the oldest of this client's goals ends: it has too many";
/// The error for a client that cancels a wish which it has not sent, or which is not kept any more.
const NOT_KEPT: &str = "id must be that of a goal of this connection";

// ---- messages -------------------------------------------------------------------------------------------------------

/// Asks for the topic that has the frames. From clients, by `/republish_tfs`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RepublishTfs;

impl Ask for RepublishTfs {
    type Answer = ();
}

/// Sends frames until cancelled. From clients, by the action or by the topic.
#[derive(Message)]
#[rtype(result = "()")]
pub struct WishFrames {
    /// The frames.
    pub sources: Vec<String>,
    /// The frame that they are seen from.
    pub target: String,
    /// Time between two messages.
    pub period: Duration,
    /// The receiver of the frames.
    pub by: FrameReceiver,
}

/// A receiver of frames.
pub enum FrameReceiver {
    /// A client that has sent a goal of the action.
    Client(Box<ActionClient>),
    /// A client that has published a goal.
    Topic {
        /// The goal's id.
        id: String,
        /// The client.
        connection: ConnectionId,
        /// Ends when the client no longer listens.
        listening: Weak<()>,
    },
}

/// The end of a wish. From clients, in the same ways.
#[derive(Message)]
#[rtype(result = "()")]
pub enum ForgetFrames {
    /// The goal of the action that the same client has sent; an error status goes there where there is none.
    Of(Canceller),
    /// The published goal of that id, or all of them.
    Published(Option<String>),
}

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `tf2_web_republisher` for an arm of `N` links.
pub struct TfRepublisher<const N: usize> {
    arm: Recipient<ArmPose<N>>,
    publish: Recipient<Publish>,
    /// Oldest first.
    wishes: VecDeque<(WishFrames, Instant)>,
    /// When the topic is due next, while somebody subscribes to it.
    topic: Option<Instant>,
    timer: Option<SpawnHandle>,
}

impl<const N: usize> TfRepublisher<N> {
    /// A node that nobody has asked yet.
    #[must_use]
    pub const fn new(arm: Recipient<ArmPose<N>>, publish: Recipient<Publish>) -> Self {
        Self {
            arm,
            publish,
            wishes: VecDeque::new(),
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

impl<const N: usize> Handler<WishFrames> for TfRepublisher<N> {
    type Result = ();

    fn handle(&mut self, wish: WishFrames, ctx: &mut Context<Self>) {
        self.forget_gone();
        let of_client = |(one, _): &(WishFrames, Instant)| one.client() == wish.client();
        let oldest = self.wishes.iter().position(of_client);
        if self.wishes.iter().filter(|one| of_client(one)).count() >= MAX_WISHES
            && let Some((oldest, _)) = oldest.and_then(|at| self.wishes.remove(at))
        {
            oldest.end(GoalStatus::Aborted, TOO_MANY);
        }
        self.wishes.push_back((wish, Instant::now()));
        self.keep_timer(ctx);
    }
}

impl<const N: usize> Handler<ForgetFrames> for TfRepublisher<N> {
    type Result = ();

    fn handle(&mut self, forget: ForgetFrames, ctx: &mut Context<Self>) {
        match forget {
            ForgetFrames::Of(who) => {
                let is_meant = |wish: &WishFrames| match &wish.by {
                    FrameReceiver::Client(client) => client.is(&who.goal),
                    FrameReceiver::Topic { .. } => false,
                };
                let at = self.wishes.iter().position(|(wish, _)| is_meant(wish));
                match at.and_then(|at| self.wishes.remove(at)) {
                    Some((wish, _)) => wish.end(GoalStatus::Canceled, Empty {}),
                    None => who.refuse(NOT_KEPT),
                }
            }
            ForgetFrames::Published(id) => self.wishes.retain(|(wish, _)| match &wish.by {
                FrameReceiver::Client(_) => true,
                FrameReceiver::Topic { id: own, .. } => id.as_ref().is_some_and(|id| id != own),
            }),
        }
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
        for (wish, _) in self.wishes.drain(..) {
            wish.end(GoalStatus::Aborted, Empty {});
        }
        self.keep_timer(ctx);
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl WishFrames {
    /// A client that has sent a goal of the action hears of its end.
    fn end(&self, status: GoalStatus, values: impl Serialize + Send + 'static) {
        if let FrameReceiver::Client(client) = &self.by {
            client.conclude(values, status);
        }
    }

    fn client(&self) -> ConnectionId {
        match &self.by {
            FrameReceiver::Client(client) => client.connection,
            FrameReceiver::Topic { connection, .. } => *connection,
        }
    }

    fn is_gone(&self) -> bool {
        match &self.by {
            FrameReceiver::Client(client) => client.is_gone(),
            FrameReceiver::Topic { listening, .. } => listening.strong_count() == 0,
        }
    }
}

impl<const N: usize> TfRepublisher<N> {
    fn forget_gone(&mut self) {
        self.wishes.retain(|(wish, _)| !wish.is_gone());
    }

    /// A timer while anybody wants frames, and none otherwise.
    fn keep_timer(&mut self, ctx: &mut Context<Self>) {
        let is_wanted = self.topic.is_some() || !self.wishes.is_empty();
        match self.timer {
            None if is_wanted => self.timer = Some(ctx.run_interval(PERIOD, Self::look)),
            Some(timer) if !is_wanted => {
                ctx.cancel_future(timer);
                self.timer = None;
            }
            _ => {}
        }
    }

    /// Asks the arm where it is, and tells those who are due.
    fn look(&mut self, ctx: &mut Context<Self>) {
        self.forget_gone();
        self.keep_timer(ctx);
        let asked = self.arm.send(ArmPose).into_actor(self);
        ctx.wait(asked.map(|pose, node, _| {
            if let Ok(pose) = pose {
                node.tell(&pose);
            }
        }));
    }

    fn tell(&mut self, pose: &Pose<N>) {
        let (now, stamp) = (Instant::now(), Stamp::from_seconds(pose.time));
        let seen = |target: &str, sources: &[String]| {
            let sources = sources.iter().map(String::as_str);
            seen_from(stamp, target, sources, &pose.lengths, &pose.positions)
        };
        // At the look that is nearest: the next would be later than this is early.
        let soon = now + PERIOD / 2;
        if let Some(due) = self.topic.as_mut().filter(|due| **due <= soon) {
            *due = next(*due, TOPIC_PERIOD, now);
            publish(&self.publish, Topic::TfWeb, seen(WORLD, &frames(N)));
        }
        let mut due: Vec<_> = self
            .wishes
            .iter_mut()
            .filter(|(_, due)| *due <= soon)
            .collect();
        // The longest due come first.
        due.sort_by_key(|(_, due)| *due);
        for (order, (wish, due)) in (0..).zip(due.into_iter().take(AT_ONCE)) {
            // A nanosecond keeps the order: wishes that are due at all times take turns.
            *due = next(*due, wish.period, now + Duration::from_nanos(order));
            let message = seen(&wish.target, &wish.sources);
            match &wish.by {
                FrameReceiver::Client(client) => client.feed_back(message),
                FrameReceiver::Topic { id, .. } => {
                    let message = answers::feedback(stamp, id.clone(), message);
                    publish(&self.publish, Topic::TfWebFeedback, message);
                }
            }
        }
    }
}

/// The next due time of a message that was due at `due` and comes `now`. A delay of up to a period is made up for.
fn next(due: Instant, period: Duration, now: Instant) -> Instant {
    (due + period).max(now)
}

fn publish(to: &Recipient<Publish>, topic: Topic, message: impl Serialize + Send + 'static) {
    to.do_send(Publish::made(topic, move || message));
}
