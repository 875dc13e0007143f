//! Places in the graph, which bridges take.
//!
//! **Invariant:** no number of a place is used twice.

use pendularm::protocol::catalog::Node;

use crate::convention::{EndpointKind, GraphNode, Named, Place, Seat};
use crate::interfaces::ServiceInterface;

/// Hands out places in the graph, each under a number of its own.
pub(super) struct Seats {
    pub(super) place: Place,
    /// The number of the last one.
    pub(super) last: usize,
}

impl Seats {
    /// The next place, for a topic.
    pub(super) fn next(
        &mut self,
        owner: Node,
        kind: EndpointKind,
        name: &str,
        type_name: &str,
        hash: &str,
    ) -> Seat {
        self.last += 1;
        let of = Named {
            name,
            type_name,
            hash,
        };
        self.place.seat(graph_node(owner), self.last, kind, of)
    }

    /// The next place, for a service.
    pub(super) fn service(
        &mut self,
        owner: Node,
        name: &str,
        interface: &ServiceInterface,
    ) -> Seat {
        let kind = EndpointKind::Service;
        self.next(owner, kind, name, interface.name, &interface.hash)
    }
}

/// A node as the graph has it.
pub(super) fn graph_node(node: Node) -> GraphNode {
    let id = Node::ALL.iter().position(|one| *one == node);
    GraphNode {
        id: id.unwrap_or_default(),
        name: node.name(),
    }
}
