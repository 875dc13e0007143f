//! The endpoints of the bridges in the graph.
//!
//! **Invariant:** every endpoint has a different number.

use pendularm::protocol::catalog::Node;

use crate::convention::{Endpoint, EndpointKind, GraphNode, Named, Place};
use crate::interfaces::ServiceInterface;

/// Creates endpoints, each with its own number.
pub(super) struct Endpoints {
    pub(super) place: Place,
    /// The last used number.
    pub(super) last: usize,
}

impl Endpoints {
    /// The next endpoint, for a topic.
    pub(super) fn next(
        &mut self,
        owner: Node,
        kind: EndpointKind,
        name: &str,
        type_name: &str,
        hash: &str,
    ) -> Endpoint {
        self.last += 1;
        let of = Named {
            name,
            type_name,
            hash,
        };
        self.place.endpoint(graph_node(owner), self.last, kind, of)
    }

    /// The next endpoint, for a service.
    pub(super) fn service(
        &mut self,
        owner: Node,
        name: &str,
        interface: &ServiceInterface,
    ) -> Endpoint {
        let kind = EndpointKind::Service;
        self.next(owner, kind, name, interface.name, &interface.hash)
    }
}

/// A node in the graph.
pub(super) fn graph_node(node: Node) -> GraphNode {
    let id = Node::ALL.iter().position(|one| *one == node);
    GraphNode {
        id: id.unwrap_or_default(),
        name: node.name(),
    }
}
