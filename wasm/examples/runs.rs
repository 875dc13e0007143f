//! Prints the runs that a test compares with those of the WebAssembly module, to the bit.

use std::io::Write as _;

fn main() -> std::io::Result<()> {
    std::io::stdout().write_all(pendularm_wasm::runs::text().as_bytes())
}
