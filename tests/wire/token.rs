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
    #[cfg(feature = "web")]
    {
        use crate::web_client::get;
        let encoded = "/?token=%73%33%63%72%65%74%2D%26%25%3B%3D%22%74%6F%6B%65%6E";
        let page = get(address, encoded);
        let name = format!("pendularm_{}=", address.port());
        assert!(page.header("set-cookie").unwrap().starts_with(&name));
        assert_eq!((page.status, get(address, "/").status), (200, 403));
    }
}
