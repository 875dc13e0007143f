//! Requests for frames in JSON.
//!
//! **Invariant:** a request names only frames of the arm. Others are refused by name.

use std::sync::Weak;
use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use serde_json::json;
use serde_json::value::RawValue;

use super::{ForgetFrames, FrameReceiver, MAX_FRAMES, RepublishTfs, TfRepublisher, WishFrames};
use crate::actors::node::Done;
use crate::actors::wire::action_client::ActionClient;
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
        let node = address.clone();
        let cancel = move |from, _| node.do_send(ForgetFrames::Of(from));
        nodes.carry_out(Action::TfSubscription, goals(address.clone()), cancel);
        let node = address.clone();
        nodes.listen(Topic::TfWebGoal, move |message| {
            match read_goal(&message, N) {
                Ok(goal) => node.do_send(goal),
                Err(rejections) => message.refuse(Topic::TfWebGoal, &rejections),
            }
        });
        let node = address.clone();
        nodes.listen(Topic::TfWebCancel, move |message| {
            match read_cancel(message.msg.raw()) {
                Ok(id) => node.do_send(ForgetFrames::Published(id)),
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
        // The topic has its own rate.
        let _ = fields.number("rate", Bound::NonNegative);
        fields.accept(Self)
    }
}

impl Answered for RepublishTfs {
    fn write((): (), to: &Address) -> Bytes {
        to.response(&json!({"topic_name": Topic::TfWeb.name()}), "")
    }
}

// ---- the action -----------------------------------------------------------------------------------------------------

fn goals<const N: usize>(
    node: Addr<TfRepublisher<N>>,
) -> impl Fn(Arguments, ActionClient, Done) + Clone {
    move |arguments, client, _| match read_wish(&arguments, N) {
        Ok((sources, target, period)) => node.do_send(WishFrames {
            sources,
            target,
            period,
            by: FrameReceiver::Client(Box::new(client)),
        }),
        Err(rejections) => client.refuse(&rejections.status()),
    }
}

/// The source frames, the target frame and the period of a request.
fn read_wish(
    arguments: &Arguments,
    links: usize,
) -> Result<(Vec<String>, String, Duration), Rejections> {
    let mut fields = Fields::of_goal(arguments, Action::TfSubscription)?;
    let sources = fields.texts("source_frames", MAX_FRAMES);
    let is_long = |name: &String| name.len() > MAX_NAME;
    if sources.iter().flatten().any(is_long) {
        let why = format!("must have names of at most {MAX_NAME} bytes");
        fields.refuse("source_frames", &why);
    }
    let target = fields
        .text("target_frame")
        .map(std::borrow::Cow::into_owned);
    let rate = fields.number("rate", Bound::NonNegative);
    if let Some(target) = target.as_ref().filter(|target| !is_frame(target, links)) {
        let why = format!("must be a frame of the arm, got {target}");
        fields.refuse("target_frame", &why);
    }
    match (sources, target, fields.accepted()) {
        (Some(sources), Some(target), true) => {
            let rate = rate.filter(|rate| *rate > 0.0).unwrap_or(RATE);
            let period = Duration::from_secs_f64(rate.max(LEAST_RATE).recip());
            Ok((sources, target, period))
        }
        _ => Err(fields.finish()),
    }
}

// ---- the topics of ROS 1's actions ----------------------------------------------------------------------------------

/// `tf2_web_republisher/TFSubscriptionActionGoal`.
fn read_goal(message: &TopicMessage, links: usize) -> Result<WishFrames, Rejections> {
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
    let (sources, target, period) = read_wish(&Arguments::Object(goal.into()), links)?;
    let by = FrameReceiver::Topic {
        id,
        connection: message.connection,
        listening: Weak::clone(&message.listening),
    };
    Ok(WishFrames {
        sources,
        target,
        period,
        by,
    })
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
