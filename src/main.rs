//! The thin binary: options in, exit status out.

fn main() {}
