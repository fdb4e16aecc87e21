//! Builds the console's page where Node is present. Where it is not, or the packages cannot be had, the page that is
//! served instead says what to install; the build itself goes on.

use std::error::Error;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Time limit of each of npm's steps.
const PATIENCE: Duration = Duration::from_secs(180);

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var_os("CARGO_FEATURE_CONSOLE").is_none() {
        return Ok(());
    }
    for source in ["index.html", "build.mjs", "package.json", "package-lock.json", "tsconfig.json", "src"] {
        println!("cargo:rerun-if-changed=console/{source}");
    }
    let page = PathBuf::from(std::env::var("OUT_DIR")?).join("console");
    fs::create_dir_all(&page)?;
    if let Err(why) = build(Path::new("console"), &page) {
        println!("cargo:warning=the web console is not built: {why}");
        // So that the next build tries again.
        println!("cargo:rerun-if-changed=console/missing");
        say_what_to_install(&page, &why)?;
    }
    Ok(())
}

/// Installs the packages that the lock file names, where they are not installed yet, and bundles the page.
fn build(console: &Path, page: &Path) -> Result<(), String> {
    run(console, "node", &["--version".as_ref()])?;
    if !is_installed(console) {
        let npm = if cfg!(windows) { "npm.cmd" } else { "npm" };
        let options = [
            "ci",
            "--ignore-scripts",
            "--no-audit",
            "--no-fund",
            "--fetch-retries=1",
            "--fetch-timeout=30000",
        ];
        run(console, npm, &options.map(OsStr::new))?;
    }
    run(console, "node", &["build.mjs".as_ref(), page.as_os_str()])
}

/// Whether the packages are those of the lock file: npm leaves its own copy beside them.
fn is_installed(console: &Path) -> bool {
    let modified = |path: PathBuf| fs::metadata(path).and_then(|file| file.modified()).ok();
    let installed = modified(console.join("node_modules/.package-lock.json"));
    installed.is_some() && installed >= modified(console.join("package-lock.json"))
}

fn run(folder: &Path, program: &str, arguments: &[&OsStr]) -> Result<(), String> {
    let shown = || {
        format!("`{program} {}`", arguments.iter().map(|a| a.to_string_lossy()).collect::<Vec<_>>().join(" "))
    };
    let mut child = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .map_err(|error| format!("{} cannot be run: {error}", shown()))?;
    let deadline = Instant::now() + PATIENCE;
    loop {
        match child.try_wait() {
            Ok(Some(status)) if status.success() => return Ok(()),
            Ok(Some(status)) => return Err(format!("{} in ground/console: {status}", shown())),
            Ok(None) if Instant::now() < deadline => std::thread::sleep(Duration::from_millis(50)),
            Ok(None) => {
                // Whether it can still be ended makes no difference to the build.
                let _ = child.kill().and_then(|()| child.wait());
                return Err(format!("{} did not end in {} s", shown(), PATIENCE.as_secs()));
            }
            Err(error) => return Err(format!("{}: {error}", shown())),
        }
    }
}

fn say_what_to_install(page: &Path, why: &str) -> std::io::Result<()> {
    let why: String = why.replace('&', "&amp;").replace('<', "&lt;");
    let html = format!(
        r#"<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>Skein console: not built</title>
<link rel="stylesheet" href="app.css">
<main>
<h1>The console is not part of this build</h1>
<p>Everything else works: the swarm flies, and the ground station takes orders over Zenoh.</p>
<p>The reason, when this program was built: {why}.</p>
<p>Install <b>Node.js 20 or later with npm</b> (Debian: <code>apt install nodejs npm</code>), see that
<code>npm ci</code> works in <code>ground/console</code>, and build again: <code>cargo build --release --workspace</code>.</p>
</main>
</html>
"#
    );
    fs::write(page.join("index.html"), html)?;
    fs::write(
        page.join("app.css"),
        "main{max-width:40em;margin:4em auto;font:16px/1.5 system-ui,sans-serif}",
    )?;
    fs::write(page.join("app.js"), "")
}
