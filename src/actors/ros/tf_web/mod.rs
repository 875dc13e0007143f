//! `tf2_web_republisher`: frames as web viewers want them, which can't put chains of frames together.
//!
//! A client that asks by the service gets the name of a topic, on which every frame comes as seen from the world. Who
//! sends a goal, by the action or by the topics of ROS 1's actions (which roslib 1 does), gets the frames that it names
//! as feedback, seen from the frame that it names, at its rate.
//!
//! **Invariant:** nothing is asked of the arm while nobody wants frames; at most [`MAX_WISHES`] wishes are kept, and a
//! client with few loses none to one with many.

mod answers;
mod wire;

use std::collections::{HashMap, VecDeque};
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

/// Wishes for frames that are kept; the oldest of the client with most gives way, for a viewer may go without a word.
pub const MAX_WISHES: usize = 64;
/// Frames that one wish may name.
pub const MAX_FRAMES: usize = 32;
/// Time between two looks at the arm, and so the shortest between two messages.
const PERIOD: Duration = Duration::from_micros(16_667);
/// Time between two messages of the topic.
const TOPIC_PERIOD: Duration = Duration::from_millis(33);
/// Messages of all wishes in one look, of which 60 come in a second: each message takes up to 30 us of the gateway's
/// thread.
const AT_ONCE: usize = 16;
/// Messages of published wishes among them: each goes to all who subscribe.
const TOPIC_AT_ONCE: usize = 5;

/// The end of a wish that gives way.
const GIVEN_WAY: &str =
    "the oldest of this client's goals gives way: there are too many, and this client has most";
/// The error for a client that cancels a wish which it has not sent, or which is not kept any more.
const NOT_KEPT: &str = "id must be that of a goal of this connection";

// ---- messages -------------------------------------------------------------------------------------------------------

/// Asks for the topic that has the frames. From clients, by `/republish_tfs`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RepublishTfs;

impl Ask for RepublishTfs {
    type Answer = ();
}

/// Frames for whoever asks, until cancelled. From clients, by the action or by the topic.
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
    pub by: Wisher,
}

/// A receiver of frames.
pub enum Wisher {
    /// A client that has sent a goal of the action.
    Client(Box<ActionClient>),
    /// Somebody who has published a goal of this id.
    Topic(String),
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
    /// Whether anybody would hear of published goals.
    feedback_is_wanted: bool,
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
            feedback_is_wanted: false,
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
        // It would be there after the last who could hear of it had gone.
        if matches!(wish.by, Wisher::Topic(_)) && !self.feedback_is_wanted {
            return;
        }
        if self.wishes.len() >= MAX_WISHES
            && let Some((oldest, _)) = self.oldest_of_most().and_then(|at| self.wishes.remove(at))
        {
            oldest.end(GoalStatus::Aborted, GIVEN_WAY);
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
                    Wisher::Client(client) => client.is(&who.goal),
                    Wisher::Topic(_) => false,
                };
                let at = self.wishes.iter().position(|(wish, _)| is_meant(wish));
                match at.and_then(|at| self.wishes.remove(at)) {
                    Some((wish, _)) => wish.end(GoalStatus::Canceled, Empty {}),
                    None => who.refuse(NOT_KEPT),
                }
            }
            ForgetFrames::Published(id) => self.forget_published(id.as_deref()),
        }
        self.keep_timer(ctx);
    }
}

impl<const N: usize> Handler<Interest> for TfRepublisher<N> {
    type Result = ();

    fn handle(&mut self, interest: Interest, ctx: &mut Context<Self>) {
        match (interest.topic, interest.wanted) {
            (Topic::TfWeb, wanted) => self.topic = wanted.then(Instant::now),
            (_, wanted) => {
                self.feedback_is_wanted = wanted;
                if !wanted {
                    self.forget_published(None);
                }
            }
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
        if let Wisher::Client(client) = &self.by {
            client.conclude(values, status);
        }
    }

    /// The client; none of who has published, which nobody knows.
    fn client(&self) -> Option<ConnectionId> {
        match &self.by {
            Wisher::Client(client) => Some(client.connection),
            Wisher::Topic(_) => None,
        }
    }

    fn is_gone(&self) -> bool {
        matches!(&self.by, Wisher::Client(client) if client.is_gone())
    }
}

impl<const N: usize> TfRepublisher<N> {
    /// The place of the oldest wish of the client that has most of them; all that are published count as one's.
    fn oldest_of_most(&self) -> Option<usize> {
        let mut clients = self.wishes.iter().map(|(wish, _)| wish.client());
        let mut counts: HashMap<_, usize> = HashMap::new();
        for client in clients.clone() {
            *counts.entry(client).or_default() += 1;
        }
        let most = counts.values().max().copied();
        clients.position(|client| counts.get(&client).copied() == most)
    }

    fn forget_published(&mut self, id: Option<&str>) {
        self.wishes.retain(|(wish, _)| match &wish.by {
            Wisher::Client(_) => true,
            Wisher::Topic(own) => id.is_some_and(|id| id != own),
        });
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
        self.wishes.retain(|(wish, _)| !wish.is_gone());
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
        let mut published = 0;
        let within_limits = due.into_iter().filter(|(wish, _)| {
            let is_published = matches!(wish.by, Wisher::Topic(_));
            published += usize::from(is_published);
            !is_published || published <= TOPIC_AT_ONCE
        });
        for (wish, due) in within_limits.take(AT_ONCE) {
            *due = next(*due, wish.period, now);
            let message = seen(&wish.target, &wish.sources);
            match &wish.by {
                Wisher::Client(client) => client.feed_back(message),
                Wisher::Topic(id) => {
                    let message = answers::feedback(stamp, id.clone(), message);
                    publish(&self.publish, Topic::TfWebFeedback, message);
                }
            }
        }
    }
}

/// When that is due again which was due at `due` and comes `now`: lateness is made up for, but not more than a period.
fn next(due: Instant, period: Duration, now: Instant) -> Instant {
    (due + period).max(now)
}

fn publish(to: &Recipient<Publish>, topic: Topic, message: impl Serialize + Send + 'static) {
    to.do_send(Publish::made(topic, move || message));
}
