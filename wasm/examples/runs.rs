//! Prints the runs that a test compares bit by bit with those of the WebAssembly module.

use std::io::Write as _;

fn main() -> std::io::Result<()> {
    std::io::stdout().write_all(pendularm_wasm::runs::text().as_bytes())
}
