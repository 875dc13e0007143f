//! The token at an address that others can reach. `tests/actors/exchanges/` has the frames and requests that show it.

use std::net::SocketAddr;

use crate::common::{Client, Runtime};
use serde_json::json;

const TOKEN: &str = "s3cret-&%;=\"token";

#[test]
fn an_address_that_others_can_reach_is_served_with_a_token() {
    let runtime = Runtime::with_bind("0.0.0.0:0", &["--token", TOKEN]);
    assert!(runtime.address.ip().is_unspecified());
    let address = SocketAddr::from(([127, 0, 0, 1], runtime.address.port()));
    let mut client = Client::to(address);
    client.send(&json!({"op": "auth", "token": TOKEN}));
    client.settle();
}
