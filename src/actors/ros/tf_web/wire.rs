//! Requests for frames in JSON.
//!
//! **Invariant:** a request names only frames of the arm. Others are refused by name.

use std::sync::Weak;
use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use serde_json::json;
use serde_json::value::RawValue;

use super::{
    FrameGoal, FrameReceiver, MAX_FRAMES, RepublishTfs, SubscribeFrames, TfRepublisher,
    UnsubscribeFrames,
};
use crate::actors::wire::action_client::Goal;
use crate::actors::wire::{Address, Answered, Callable, Nodes, TopicMessage};
use crate::protocol::catalog::{Action, Service, Topic};
use crate::protocol::limits::MAX_NAME;
use crate::protocol::messages::scene::{WORLD, is_frame};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, RejectedField, Rejections};
use crate::protocol::wire::{json, text};

/// Default rate in messages per second.
const RATE: f64 = 10.0;
/// Least rate in messages per second. A lower rate is raised to this.
const LEAST_RATE: f64 = 0.1;

impl<const N: usize> TfRepublisher<N> {
    /// Adds this node's service, action and topics to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.serve::<RepublishTfs>(Service::RepublishTfs, address.clone());
        nodes.carry_out::<FrameGoal<N>, _>(address.clone());
        let node = address.clone();
        nodes.listen(Topic::TfWebGoal, move |message| {
            match read_goal::<N>(&message) {
                Ok(goal) => node.do_send(goal),
                Err(rejections) => message.refuse(Topic::TfWebGoal, &rejections),
            }
        });
        let node = address.clone();
        nodes.listen(Topic::TfWebCancel, move |message| {
            match read_cancel(message.msg.raw()) {
                Ok(id) => node.do_send(UnsubscribeFrames(id)),
                Err(rejections) => message.refuse(Topic::TfWebCancel, &rejections),
            }
        });
        for topic in [Topic::TfWeb, Topic::TfWebFeedback] {
            nodes.publishers.insert(topic, address.clone().recipient());
        }
    }
}

// ---- the service ----------------------------------------------------------------------------------------------------

impl Callable for RepublishTfs {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let target = fields.text("target_frame");
        if let Some(target) = target.filter(|target| target.trim_start_matches('/') != WORLD) {
            let why = format!("must be {WORLD}, got {target}: the action supports others");
            fields.refuse("target_frame", &why);
        }
        // The topic has every frame, and its own rate.
        let _ = fields.texts("source_frames", MAX_FRAMES);
        let _ = fields.number("rate", Bound::NonNegative);
        let _ = fields.object("timeout", |_| ());
        check_thresholds(&mut fields);
        fields.accept(Self)
    }
}

impl Answered for RepublishTfs {
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

impl<const N: usize> Goal for FrameGoal<N> {
    const ACTION: Action = Action::TfSubscription;

    fn read(arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::of_goal(arguments, Action::TfSubscription)?;
        let sources = fields.texts("source_frames", MAX_FRAMES);
        let is_long = |name: &String| name.len() > MAX_NAME;
        if sources.iter().flatten().any(is_long) {
            let why = format!("must have names of at most {MAX_NAME} bytes");
            fields.refuse("source_frames", &why);
        }
        let target = fields.text("target_frame");
        let rate = fields.number("rate", Bound::NonNegative);
        if let Some(target) = target.as_ref().filter(|target| !is_frame(target, N)) {
            let why = format!("must be a frame of the arm, got {target}");
            fields.refuse("target_frame", &why);
        }
        check_thresholds(&mut fields);
        let rate = rate.filter(|rate| *rate > 0.0).unwrap_or(RATE);
        fields.accept(Self {
            sources: sources.unwrap_or_default(),
            target: target.unwrap_or_default().into_owned(),
            period: Duration::from_secs_f64(rate.max(LEAST_RATE).recip()),
        })
    }
}

// ---- the topics of ROS 1's actions ----------------------------------------------------------------------------------

/// `tf2_web_republisher/TFSubscriptionActionGoal`.
fn read_goal<const N: usize>(message: &TopicMessage) -> Result<SubscribeFrames<N>, Rejections> {
    let [id, goal] = members(message.msg.raw(), &["goal_id", "goal"])?;
    let id = id.and_then(|id| json::members(id.get(), &["id"]).ok());
    let id = id.and_then(|[id]| json::text(id?));
    let id = id.ok_or_else(|| refused("goal_id.id", &"must be a string"))?;
    if id.len() > MAX_NAME {
        let why = format!("must be at most {MAX_NAME} bytes long");
        return Err(refused("goal_id.id", &why));
    }
    let id = id.into_owned();
    let goal = goal.ok_or_else(|| refused("goal", &"is required"))?;
    let goal = Goal::read(&Arguments::Object(goal.into()))?;
    let by = FrameReceiver::Topic {
        id,
        connection: message.connection,
        listening: Weak::clone(&message.listening),
    };
    Ok(SubscribeFrames { goal, by })
}

/// `actionlib_msgs/GoalID`: an id, or none for all goals.
fn read_cancel(msg: &RawValue) -> Result<Option<String>, Rejections> {
    let [id] = members(msg, &["id"])?;
    let Some(id) = id else {
        return Ok(None);
    };
    let text = json::text(id).ok_or_else(|| {
        let found = text::found(id);
        refused("id", &format!("must be a string, got {found}"))
    })?;
    Ok(Some(text.into_owned()).filter(|id| !id.is_empty()))
}

/// The members of these names in a message.
fn members<'a, const M: usize>(
    msg: &'a RawValue,
    names: &[&str; M],
) -> Result<[Option<&'a RawValue>; M], Rejections> {
    json::members(msg.get(), names).map_err(|_| refused("msg", &"must be an object"))
}

fn refused(field: &str, why: &impl std::fmt::Display) -> Rejections {
    RejectedField::refused(field, why).into()
}
