//! The wire conventions of `rmw_zenoh` (ROS 2 Jazzy): names, tokens, attachments, type hashes. Pure.
//!
//! **Invariant:** only this module has the names of ROS 2 on Zenoh.

pub mod attachment;
pub mod hash;

use twox_hash::XxHash3_128;

/// The depth of a peer's queue in the graph.
const DEPTH: usize = 10;

/// The place of all names: a domain, a namespace in it, and the session.
#[derive(Debug, Clone)]
pub struct Place {
    /// The ROS domain.
    pub domain: u32,
    /// Empty, or a namespace with a leading slash: `/left`.
    pub namespace: String,
    /// The Zenoh session's id.
    pub zid: String,
}

/// A kind of endpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EndpointKind {
    /// A publisher.
    Publisher,
    /// A publisher that sends its last message to a new subscription.
    LatchedPublisher,
    /// A subscription.
    Subscription,
    /// A service.
    Service,
}

impl EndpointKind {
    const fn code(self) -> &'static str {
        match self {
            Self::Publisher | Self::LatchedPublisher => "MP",
            Self::Subscription => "MS",
            Self::Service => "SS",
        }
    }

    /// Reliability, durability, history and depth, deadline, lifespan, liveliness. Empty means the default.
    fn qos(self) -> String {
        match self {
            Self::LatchedPublisher => ":1:,1:,:,:,,".to_owned(),
            _ => format!("::,{DEPTH}:,:,:,,"),
        }
    }
}

/// A topic or service with its type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Named<'a> {
    /// Its name without a namespace: `/joint_states`.
    pub name: &'a str,
    /// Its type: `sensor_msgs/msg/JointState`.
    pub type_name: &'a str,
    /// The type's hash.
    pub hash: &'a str,
}

/// An endpoint: the key expression of its messages, and its token in the graph.
#[derive(Debug, Clone)]
pub struct Endpoint {
    /// The key expression.
    pub key: String,
    /// The token.
    pub token: String,
}

/// A node in the graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GraphNode {
    /// Its number in the session.
    pub id: usize,
    /// Its name.
    pub name: &'static str,
}

impl Place {
    /// The name after the namespace.
    fn full_name(&self, name: &str) -> String {
        format!("{}{name}", self.namespace)
    }

    /// The key expression of a topic's messages or a service's requests.
    fn key(&self, of: Named<'_>) -> String {
        let full = self.full_name(of.name);
        let name = full.trim_matches('/');
        format!(
            "{}/{name}/{}/{}",
            self.domain,
            dds_type(of.type_name),
            of.hash
        )
    }

    /// The token of a node in the graph.
    #[must_use]
    pub fn node_token(&self, node: GraphNode) -> String {
        self.token_head(node, node.id, "NN")
    }

    /// The token of a node's endpoint in the graph.
    fn token(&self, node: GraphNode, id: usize, kind: EndpointKind, of: Named<'_>) -> String {
        format!(
            "{}/{}/{}/{}/{}",
            self.token_head(node, id, kind.code()),
            mangled(&self.full_name(of.name)),
            dds_type(of.type_name),
            of.hash,
            kind.qos()
        )
    }

    /// An endpoint of a node.
    #[must_use]
    pub fn endpoint(
        &self,
        node: GraphNode,
        id: usize,
        kind: EndpointKind,
        of: Named<'_>,
    ) -> Endpoint {
        Endpoint {
            key: self.key(of),
            token: self.token(node, id, kind, of),
        }
    }

    /// The parts up to the node's name. The enclave is empty.
    fn token_head(&self, node: GraphNode, id: usize, code: &str) -> String {
        format!(
            "@ros2_lv/{}/{}/{}/{id}/{code}/%/{}/{}",
            self.domain,
            self.zid,
            node.id,
            mangled(&self.namespace),
            node.name
        )
    }
}

/// The id of an endpoint, which identifies the sender of its messages.
#[must_use]
pub fn gid(token: &str) -> [u8; attachment::GID] {
    // The lower half is first.
    XxHash3_128::oneshot(token.as_bytes()).to_le_bytes()
}

/// The name of a type in DDS: `sensor_msgs::msg::dds_::JointState_`.
fn dds_type(name: &str) -> String {
    match name.rsplit_once('/') {
        Some((package, last)) => format!("{}::dds_::{last}_", package.replace('/', "::")),
        None => format!("{name}_"),
    }
}

/// A name as one part of a key expression.
fn mangled(name: &str) -> String {
    match name {
        "" => "%".to_owned(),
        name => name.replace('/', "%"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRING: Named<'_> = Named {
        name: "/chatter",
        type_name: "std_msgs/msg/String",
        hash: "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    };
    const TALKER: GraphNode = GraphNode {
        id: 0,
        name: "talker",
    };

    fn place(namespace: &str) -> Place {
        Place {
            domain: 2,
            namespace: namespace.to_owned(),
            zid: "8b20917502ee955ac4476e0266340d5c".to_owned(),
        }
    }

    /// The examples of `rmw_zenoh`'s design document, except the depth of the queue.
    #[test]
    fn names_are_those_of_the_design_document() {
        let here = place("");
        let hash = STRING.hash;
        assert_eq!(
            here.key(STRING),
            format!("2/chatter/std_msgs::msg::dds_::String_/{hash}")
        );
        assert_eq!(
            here.node_token(TALKER),
            "@ros2_lv/2/8b20917502ee955ac4476e0266340d5c/0/0/NN/%/%/talker"
        );
        assert_eq!(
            here.token(TALKER, 10, EndpointKind::Publisher, STRING),
            format!(
                "@ros2_lv/2/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/\
                 {hash}/::,10:,:,:,,"
            )
        );
    }

    #[test]
    fn a_namespace_is_in_front_of_the_name_and_beside_the_node() {
        let left = place("/robots/left");
        assert!(left.key(STRING).starts_with("2/robots/left/chatter/"));
        let token = left.token(TALKER, 3, EndpointKind::Service, STRING);
        assert!(
            token.contains("/0/3/SS/%/%robots%left/talker/%robots%left%chatter/"),
            "{token}"
        );
        let latched = left.token(TALKER, 3, EndpointKind::LatchedPublisher, STRING);
        assert!(latched.ends_with("/:1:,1:,:,:,,"), "{latched}");
    }

    /// `xxhash.xxh3_128(b"talker")` of the Python package xxhash, its bytes reversed.
    #[test]
    fn a_gid_is_the_hash_of_the_token_with_its_lower_half_first() {
        let number = u128::from_be_bytes(gid("talker"));
        assert_eq!(number, 0x3e9b_3d2e_f749_af17_20f5_8afb_5a11_9735);
    }
}
