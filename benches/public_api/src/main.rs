//! Prints the public items of a library, one on each line: `public_api FILE`, a file of rustdoc's JSON.
//!
//! Implementations that the compiler derives or adds by itself are left out.

#![forbid(unsafe_code)]

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args().nth(1).ok_or("usage: public_api FILE")?;
    let library = public_api::Builder::from_rustdoc_json(file)
        .omit_blanket_impls(true)
        .omit_auto_trait_impls(true)
        .omit_auto_derived_impls(true)
        .build()?;
    for item in library.items() {
        println!("{item}");
    }
    Ok(())
}
