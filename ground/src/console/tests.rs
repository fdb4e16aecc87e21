//! The messages between station and console as TypeScript, in `ground/console/src/messages.ts`.

use std::collections::BTreeMap;
use std::path::Path;

use ts_rs::{Config, TS, TypeVisitor};

use super::{feed, request};

const REFRESH: &str = "SKEIN_REFRESH=1 cargo test -p skein-ground --lib typescript";

/// Declarations by name.
struct Declarations {
    config: Config,
    found: BTreeMap<String, String>,
}

impl TypeVisitor for Declarations {
    fn visit<T: TS + 'static + ?Sized>(&mut self) {
        // Those without a file of their own are TypeScript's own types.
        if T::output_path().is_none() || self.found.contains_key(&T::ident(&self.config)) {
            return;
        }
        let docs = T::docs().unwrap_or_default();
        self.found.insert(T::ident(&self.config), format!("{docs}export {}\n", T::decl(&self.config)));
        T::visit_dependencies(self);
    }
}

#[test]
fn the_console_has_the_messages_in_typescript() {
    let config = Config::new().with_large_int("number");
    let mut declarations = Declarations { config, found: BTreeMap::new() };
    declarations.visit::<feed::Message<'static>>();
    declarations.visit::<feed::StateView<'static>>();
    declarations.visit::<request::Message>();
    let head = format!(
        "/**\n * Station and console say these to each other. Made from the station's types in `ground/src`; to make it anew:\n *\n *     {REFRESH}\n */\n\nimport type {{ What }} from './vocabulary';\nimport type {{ ZoneTable }} from './zone';\n\n"
    );
    let declared = declarations.found.into_values().collect::<Vec<_>>().join("\n");
    let text: String = (head + &declared).lines().map(|line| line.trim_end().to_owned() + "\n").collect();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("console/src/messages.ts");
    if std::env::var_os("SKEIN_REFRESH").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(committed == text, "{} is stale; refresh it: {REFRESH}", path.display());
}
