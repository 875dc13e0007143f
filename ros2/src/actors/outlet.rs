//! A publisher in the graph: bytes out, numbered.
//!
//! **Invariant:** the messages of a publisher are numbered from 1 without gaps.

use std::time::Duration;

use zenoh::liveliness::LivelinessToken;
use zenoh::matching::MatchingListener;
use zenoh::{Session, Wait};
use zenoh_ext::{AdvancedPublisher, AdvancedPublisherBuilderExt, CacheConfig, MissDetectionConfig};

use crate::convention::attachment::{Attachment, GID};
use crate::convention::{Endpoint, gid};
use crate::report;

/// The interval in which a latched topic announces its last message after a new one, as in `rmw_zenoh`.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// The parts of a publisher with the same lifetime.
struct Parts {
    publisher: AdvancedPublisher<'static>,
    _token: LivelinessToken,
    #[allow(dead_code, reason = "it lives as long as this")]
    watched: Option<MatchingListener<()>>,
}

/// A publisher in the graph.
pub(super) struct Outlet {
    /// Declared until it is dropped.
    parts: Option<Parts>,
    key: String,
    gid: [u8; GID],
    sequence: i64,
}

impl Outlet {
    /// Declares a publisher. A latched one sends its last message to late subscribers.
    pub(super) fn new(
        session: &Session,
        endpoint: Endpoint,
        is_latched: bool,
    ) -> zenoh::Result<Self> {
        let gid = gid(&endpoint.token);
        let builder = session.declare_publisher(endpoint.key.clone()).advanced();
        let builder = if is_latched {
            builder
                .publisher_detection()
                .cache(CacheConfig::default().max_samples(1))
                .sample_miss_detection(MissDetectionConfig::default().sporadic_heartbeat(HEARTBEAT))
        } else {
            builder
        };
        let parts = Parts {
            publisher: builder.wait()?,
            _token: session.liveliness().declare_token(endpoint.token).wait()?,
            watched: None,
        };
        Ok(Self {
            parts: Some(parts),
            key: endpoint.key,
            gid,
            sequence: 0,
        })
    }

    /// Reports whether there are subscribers, at every change.
    pub(super) fn watch(
        &mut self,
        tell: impl Fn(bool) + Send + Sync + 'static,
    ) -> zenoh::Result<()> {
        if let Some(parts) = &mut self.parts {
            let tell = move |status: zenoh::matching::MatchingStatus| tell(status.matching());
            let listener = parts.publisher.matching_listener().callback(tell);
            parts.watched = Some(listener.wait()?);
        }
        Ok(())
    }

    /// Publishes a message.
    pub(super) fn put(&mut self, payload: Vec<u8>) {
        let Some(parts) = &self.parts else { return };
        self.sequence += 1;
        let attachment = Attachment::now(self.sequence, self.gid).bytes();
        let put = parts.publisher.put(payload).attachment(attachment);
        if let Err(error) = put.wait() {
            report::say(&format!("{}: {error}", self.key));
        }
    }
}

impl Drop for Outlet {
    fn drop(&mut self) {
        // Zenoh waits for the end of the heartbeat's task, which is not allowed on a thread of an asynchronous runtime.
        let parts = self.parts.take();
        std::thread::spawn(move || drop(parts));
    }
}
