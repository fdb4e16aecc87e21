//! The shell's end of the console: the same messages as a browser's.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context as _, anyhow, bail};
use clap::Args;
use nix::unistd::{Uid, User};
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};
use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

/// The station speaks ten times a second; after this long without a word it is gone.
const PATIENCE: Duration = Duration::from_secs(5);

/// Where the station is, and who speaks.
#[derive(Args, Clone, Debug)]
pub(super) struct Call {
    /// The console's address, as the station names it; https:// asks for a certificate.
    #[arg(long, value_name = "URL", default_value = "http://127.0.0.1:8700")]
    console: String,
    /// The name of whoever gives the order [default: that of your account, or of your certificate].
    #[arg(long, value_name = "NAME")]
    by: Option<String>,
    /// The fleet's authority (PEM), for https.
    #[arg(long, value_name = "FILE", requires = "certificate")]
    authority: Option<PathBuf>,
    /// Your certificate (PEM), for https.
    #[arg(long, value_name = "FILE", requires = "key")]
    certificate: Option<PathBuf>,
    /// Its private key (PEM).
    #[arg(long, value_name = "FILE", requires = "authority")]
    key: Option<PathBuf>,
}

trait Stream: Read + Write {}
impl<T: Read + Write> Stream for T {}

/// A connection to a station's console.
pub(super) struct Caller {
    socket: WebSocket<Box<dyn Stream>>,
    pub(super) name: String,
}

impl Call {
    /// Connects, and says who speaks.
    pub(super) fn connect(&self) -> anyhow::Result<Caller> {
        let (secure, host) = match self.console.split_once("://") {
            Some(("https", host)) => (true, host),
            Some(("http", host)) => (false, host),
            None => (false, self.console.as_str()),
            Some(_) => {
                bail!("`--console` is {}: expected http://HOST:PORT or https://HOST:PORT", self.console)
            }
        };
        let host = host.trim_end_matches('/');
        let stream = TcpStream::connect(host).with_context(|| {
            format!("`--console`: no station answers at {host}: is `skein-ground serve` running?")
        })?;
        stream.set_read_timeout(Some(PATIENCE))?;
        stream.set_nodelay(true)?;
        let stream: Box<dyn Stream> =
            if secure { Box::new(self.secure(stream, host)?) } else { Box::new(stream) };
        let scheme = if secure { "wss" } else { "ws" };
        let (socket, _) = tungstenite::client(format!("{scheme}://{host}/live"), stream)
            .map_err(|error| anyhow!("{host} turns this away: {}", refusal(error)))?;
        let mut caller = Caller { socket, name: String::new() };
        caller.introduce(self.by.as_deref())?;
        Ok(caller)
    }

    fn secure(
        &self,
        stream: TcpStream,
        host: &str,
    ) -> anyhow::Result<StreamOwned<ClientConnection, TcpStream>> {
        let (Some(authority), Some(certificate), Some(key)) = (&self.authority, &self.certificate, &self.key)
        else {
            bail!("https needs `--authority`, `--certificate` and `--key`");
        };
        let mut roots = RootCertStore::empty();
        for root in
            CertificateDer::pem_file_iter(authority).with_context(|| authority.display().to_string())?
        {
            roots.add(root.with_context(|| authority.display().to_string())?)?;
        }
        let chain = CertificateDer::pem_file_iter(certificate)
            .and_then(Iterator::collect::<Result<Vec<_>, _>>)
            .with_context(|| certificate.display().to_string())?;
        let key = PrivateKeyDer::from_pem_file(key).with_context(|| key.display().to_string())?;
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let config = ClientConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()?
            .with_root_certificates(roots)
            .with_client_auth_cert(chain, key)?;
        let name = host.rsplit_once(':').map_or(host, |(name, _)| name).trim_matches(['[', ']']);
        let name = ServerName::try_from(name.to_owned()).with_context(|| format!("`--console`: {name}"))?;
        Ok(StreamOwned::new(ClientConnection::new(Arc::new(config), name)?, stream))
    }
}

/// The console's word to those whom it turns away.
fn refusal<R: tungstenite::handshake::HandshakeRole>(error: tungstenite::HandshakeError<R>) -> String {
    match error {
        tungstenite::HandshakeError::Failure(tungstenite::Error::Http(answer)) => {
            let body = answer.body().as_deref().map(String::from_utf8_lossy);
            body.filter(|body| !body.is_empty()).map_or_else(|| answer.status().to_string(), Into::into)
        }
        tungstenite::HandshakeError::Failure(error) => error.to_string(),
        tungstenite::HandshakeError::Interrupted(_) => "it does not answer".into(),
    }
}

/// The name of the account that this runs under.
fn account() -> Option<String> {
    let named = ["USER", "USERNAME"].iter().find_map(|variable| std::env::var(variable).ok());
    named.or_else(|| User::from_uid(Uid::current()).ok().flatten().map(|user| user.name))
}

impl Caller {
    fn introduce(&mut self, by: Option<&str>) -> anyhow::Result<()> {
        let you = self.next_of("you")?;
        let certified = you["name"].as_str().filter(|_| you["certified"] == true);
        let name = match (by, certified) {
            (Some(name), _) | (None, Some(name)) => name.to_owned(),
            (None, None) => {
                account().context("your account has no name, and orders need one: add `--by NAME`")?
            }
        };
        let you = self.ask(json!({ "type": "hello", "name": name }), "you")?;
        self.name = you["name"].as_str().unwrap_or_default().to_owned();
        Ok(())
    }

    /// Sends a request, and waits for an answer of this type.
    ///
    /// # Errors
    /// The station refuses, and says why.
    pub(super) fn ask(&mut self, request: Value, expected: &str) -> anyhow::Result<Value> {
        self.ask_within(request, expected, PATIENCE)
    }

    /// The same of what takes the station longer to answer.
    pub(super) fn ask_within(
        &mut self,
        mut request: Value,
        expected: &str,
        patience: Duration,
    ) -> anyhow::Result<Value> {
        let tag = "shell";
        request["tag"] = tag.into();
        self.socket.send(Message::text(request.to_string()))?;
        let deadline = Instant::now() + patience;
        while Instant::now() < deadline {
            let message = self.next()?;
            if message["tag"] != tag {
                continue;
            }
            if message["type"] == "error" {
                bail!("{}", message["message"].as_str().unwrap_or("the station refuses without saying why"));
            }
            if message["type"] == expected {
                return Ok(message);
            }
        }
        bail!("the station has not answered within {} s", patience.as_secs())
    }

    /// The next message of this type.
    pub(super) fn next_of(&mut self, kind: &str) -> anyhow::Result<Value> {
        loop {
            let message = self.next()?;
            if message["type"] == kind {
                return Ok(message);
            }
        }
    }

    /// The next message of this type, if one comes in time.
    pub(super) fn next_of_within(&mut self, kind: &str, deadline: Instant) -> anyhow::Result<Option<Value>> {
        while Instant::now() < deadline {
            let message = self.next()?;
            if message["type"] == kind {
                return Ok(Some(message));
            }
        }
        Ok(None)
    }

    fn next(&mut self) -> anyhow::Result<Value> {
        loop {
            if let Message::Text(text) = self.socket.read().context("the station has gone")? {
                return Ok(serde_json::from_str(&text)?);
            }
        }
    }
}
