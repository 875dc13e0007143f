//! WebSocket clients that do not read. `exchanges/connections.txt` has their deadline.

use super::*;

/// Pings of a peer that reads no pong: fewer pongs wait for it than one write holds. When it reads, the last ping has
/// been answered.
#[test]
fn pings_whose_pongs_are_not_read_cost_next_to_nothing() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut stream = open(&gateway, 64 * 1024).await.into_stream();
        for n in 0..20_000_u32 {
            let mut ping = vec![0x89, 0x80 | 125, 0, 0, 0, 0];
            ping.extend_from_slice(&n.to_be_bytes());
            ping.resize(6 + 125, b'x');
            stream.write_all(&ping).await.unwrap();
        }
        settle().await;
        let (mut last, mut pongs) = (0, 0);
        while last != 19_999 {
            let mut pong = [0; 127];
            stream.read_exact(&mut pong).await.unwrap();
            assert_eq!(pong[..2], [0x8a, 125], "a pong");
            last = u32::from_be_bytes([pong[2], pong[3], pong[4], pong[5]]);
            pongs += 1;
        }
        assert!(pongs * 127 <= (64 + 72) * 1024, "{pongs} pongs waited");
    });
}
