//! Compiles `proto/skein.proto` to Rust types and to a descriptor set; needs no `protoc`.

use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=proto/skein.proto");
    let mut compiler = protox::Compiler::new(["proto"])?;
    compiler.include_source_info(true).include_imports(true).open_file("skein.proto")?;
    let descriptors = PathBuf::from(std::env::var("OUT_DIR")?).join("skein.bin");
    std::fs::write(descriptors, compiler.encode_file_descriptor_set())?;
    // Ordered maps, so that equal messages are equal bytes.
    prost_build::Config::new().btree_map(["."]).compile_fds(compiler.file_descriptor_set())?;
    Ok(())
}
