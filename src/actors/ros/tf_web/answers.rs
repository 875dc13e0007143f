//! The feedback of a published request, under the id of the request.
//!
//! **Invariant:** the fields are those of the catalog.

use serde::Serialize;

use crate::protocol::messages::scene::TfMessage;
use crate::protocol::messages::{Header, Stamp};

/// `tf2_web_republisher/TFSubscriptionActionFeedback`.
#[derive(Serialize)]
pub(super) struct FramesFeedback {
    header: Header<'static>,
    status: RequestStatus,
    feedback: TfMessage,
}

/// `actionlib_msgs/GoalStatus`.
#[derive(Serialize)]
struct RequestStatus {
    goal_id: RequestId,
    status: u8,
    text: &'static str,
}

/// `actionlib_msgs/GoalID`.
#[derive(Serialize)]
struct RequestId {
    stamp: Stamp,
    id: String,
}

pub(super) fn feedback(stamp: Stamp, id: String, feedback: TfMessage) -> FramesFeedback {
    let frame_id = "";
    FramesFeedback {
        header: Header { stamp, frame_id },
        status: RequestStatus {
            goal_id: RequestId { stamp, id },
            // The status `active` of ROS 1.
            status: 1,
            text: "",
        },
        feedback,
    }
}
