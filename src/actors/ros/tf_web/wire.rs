//! Requests for frames in JSON.
//!
//! **Invariant:** a request has only frames of the arm. Unknown ones are left out, and an unknown target is refused.

use std::borrow::Cow;
use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use serde_json::json;

use super::{CancelPublished, FrameGoal, MAX_FRAMES, PublishedGoal, RepublishTfs, TfRepublisher};
use crate::actors::node::{ActionClient, Address, Ask, ForwardGoal, Nodes, SentGoal, TopicMessage};
use crate::protocol::catalog::{Action, Service, Topic};
use crate::protocol::limits::MAX_NAME;
use crate::protocol::messages::scene::{WORLD, is_frame};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::protocol::wire::json::Payload;

/// Default rate in messages per second.
const RATE: f64 = 10.0;
/// Least rate in messages per second. A lower rate is raised to this.
const LEAST_RATE: f64 = 0.1;

/// Adds the node's service, action and topics to the registry's table.
pub fn attach<const N: usize>(address: &Addr<TfRepublisher<N>>, nodes: &mut Nodes) {
    nodes.serve::<RepublishTfs>(Service::RepublishTfs, address.clone());
    nodes.serve_action::<FrameGoal<N>, _>(address.clone());
    let start = |(id, goal), message: TopicMessage| {
        let listening = message.listening;
        let published = Some(PublishedGoal { id, listening });
        let client = ActionClient {
            link: message.link,
            action: Action::TfSubscription.name().into(),
            id: message.id,
            wants_feedback: false,
        };
        let (goal, working) = (FrameGoal { published, ..goal }, message.working);
        ForwardGoal {
            goal,
            client,
            working,
        }
    };
    nodes.subscribe(Topic::TfWebGoal, address.clone(), read_goal::<N>, start);
    let cancel = |id, _| CancelPublished(id);
    nodes.subscribe(Topic::TfWebCancel, address.clone(), read_cancel, cancel);
}

// ---- the service ----------------------------------------------------------------------------------------------------

impl Ask for RepublishTfs {
    type Answer = ();

    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let target = fields.text("target_frame");
        if let Some(target) = target.filter(|target| target.trim_start_matches('/') != WORLD) {
            let why = format!(
                "must be {WORLD}, got {target}: the action {} supports others",
                Action::TfSubscription.name()
            );
            fields.refuse("target_frame", &why);
        }
        // The topic has every frame, and its own rate.
        let _ = fields.texts("source_frames", MAX_FRAMES);
        let _ = fields.number("rate", Bound::NonNegative);
        let _ = fields.object("timeout", |_| ());
        check_thresholds(&mut fields);
        fields.accept(Self)
    }

    fn write((): (), to: &Address) -> Bytes {
        to.response(&json!({"topic_name": Topic::TfWeb.name()}), "")
    }
}

/// Checks the thresholds, which have no effect.
fn check_thresholds(fields: &mut Fields<'_>) {
    for name in ["angular_thres", "trans_thres"] {
        let _ = fields.number(name, Bound::Finite);
    }
}

// ---- the action -----------------------------------------------------------------------------------------------------

impl<const N: usize> SentGoal for FrameGoal<N> {
    const ACTION: Action = Action::TfSubscription;

    fn read(arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::of_goal(arguments, Self::ACTION)?;
        let goal = Self::of(&mut fields);
        fields.accept(goal)
    }
}

impl<const N: usize> FrameGoal<N> {
    fn of(fields: &mut Fields<'_>) -> Self {
        let sources = fields.texts("source_frames", MAX_FRAMES);
        let mut sources = sources.unwrap_or_default();
        sources.retain(|name| is_frame(name, N));
        let target = fields.text("target_frame");
        let rate = fields.number("rate", Bound::NonNegative);
        if let Some(target) = target.as_ref().filter(|target| !is_frame(target, N)) {
            let why = format!("must be a frame of the arm, got {target}");
            fields.refuse("target_frame", &why);
        }
        check_thresholds(fields);
        let rate = rate.filter(|rate| *rate > 0.0).unwrap_or(RATE);
        Self {
            sources,
            target: target.unwrap_or_default().into_owned(),
            period: Duration::from_secs_f64(rate.max(LEAST_RATE).recip()),
            published: None,
        }
    }
}

// ---- the topics of ROS 1's actions ----------------------------------------------------------------------------------

/// The id and the goal of a `tf2_web_republisher/TFSubscriptionActionGoal`.
fn read_goal<const N: usize>(msg: &Payload) -> Result<(String, FrameGoal<N>), Rejections> {
    let mut fields = Fields::of_message(msg, Topic::TfWebGoal)?;
    let id = fields.object("goal_id", |fields| {
        let id = fields.text("id").unwrap_or_default();
        if id.len() > MAX_NAME {
            fields.refuse("id", &format!("must be at most {MAX_NAME} bytes long"));
        }
        id.into_owned()
    });
    let goal = fields.object("goal", FrameGoal::of);
    match id.zip(goal) {
        Some(read) => fields.accept(read),
        None => Err(fields.finish()),
    }
}

/// The id of an `actionlib_msgs/GoalID`, or none for all goals.
fn read_cancel(msg: &Payload) -> Result<Option<String>, Rejections> {
    let mut fields = Fields::of_message(msg, Topic::TfWebCancel)?;
    let id = fields.text("id").filter(|id| !id.is_empty());
    let id = id.map(Cow::into_owned);
    fields.accept(id)
}
