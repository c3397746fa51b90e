//! Compiles the C files below `c` with the compiler that `CC` names, or `cc`, and archives them with `AR`, or `ar`.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

const SOURCES: [&str; 5] = ["model.c", "problem.c", "instance.c", "runtime/hs.c", "shim.c"];
/// The flags with which every digit is that of `hsdsl run`.
const EXACT: &[&str] = &[
    @EXACT@,
];
const MARK: &[u8] = b"hybrid_words:";

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    println!("cargo:rerun-if-changed=c");
    let mut compiler = tool("CC", "cc");
    compiler.extend(["-O2", "-fPIC", "-DHS_NO_CLOCK", "-Ic", "-Ic/runtime", "-include", "c/prefix.h"].map(String::from));
    compiler.extend(EXACT.iter().map(|flag| flag.to_string()));
    if env::var_os("CARGO_FEATURE_STD").is_some() {
        compiler.push("-DHS_GROWS".to_string());
    }
    compiler.extend(tool("CFLAGS", ""));
    let objects: Vec<PathBuf> = SOURCES.iter().map(|name| out.join(name.replace('/', "_")).with_extension("o")).collect();
    run_all(SOURCES.iter().zip(&objects).map(|(name, object)| {
        let words = [String::from("-c"), format!("c/{}", name), String::from("-o"), text(object)];
        [&compiler[..], &words[..]].concat()
    }));
    fs::write(out.join("words.rs"), words(&objects[4]).to_string()).expect("OUT_DIR can be written");
    let archive = out.join("lib@PREFIX@.a");
    fs::remove_file(&archive).ok(); // of an earlier build, to which `ar` would add
    let mut archiver = tool("AR", "ar");
    archiver.extend([String::from("crs"), text(&archive)]);
    archiver.extend(objects.iter().map(|object| text(object)));
    run_all(std::iter::once(archiver));
    println!("cargo:rustc-link-search=native={}", out.display());
    println!("cargo:rustc-link-lib=static=@PREFIX@");
    if env::var("CARGO_CFG_TARGET_OS").map_or(true, |system| system != "macos" && system != "windows") {
        println!("cargo:rustc-link-lib=m");
    }
}

/// The words of a variable of the environment, of that for the target first.
fn tool(name: &str, default: &str) -> Vec<String> {
    let target = env::var("TARGET").unwrap_or_default().replace('-', "_");
    let names = [format!("{}_{}", name, target), name.to_string()];
    for name in &names {
        println!("cargo:rerun-if-env-changed={}", name);
    }
    let given = names.iter().find_map(|name| env::var(name).ok()).unwrap_or_else(|| default.to_string());
    given.split_whitespace().map(String::from).collect()
}

fn text(path: &Path) -> String {
    path.to_str().expect("paths are UTF-8").to_string()
}

/// Run commands at the same time, until all have succeeded.
fn run_all(commands: impl Iterator<Item = Vec<String>>) {
    let started: Vec<_> = commands
        .map(|words| match Command::new(&words[0]).args(&words[1..]).spawn() {
            Ok(child) => (words, child),
            Err(error) => panic!("this crate needs a C compiler and `ar`; {}: {}", words[0], error),
        })
        .collect();
    for (words, mut child) in started {
        let status = child.wait().expect("a program that was started ends");
        assert!(status.success(), "{} failed", words.join(" "));
    }
}

/// How many words of memory a run takes, which the compiler wrote into an object, since a target cannot be asked.
fn words(object: &Path) -> usize {
    let bytes = fs::read(object).expect("the object was made");
    let at = bytes.windows(MARK.len()).position(|part| part == MARK).expect("shim.o has its mark") + MARK.len();
    bytes[at..at + 10].iter().fold(0, |sum, digit| 10 * sum + usize::from(digit - b'0'))
}
