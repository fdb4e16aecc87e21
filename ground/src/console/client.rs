//! One browser: it is told what is so, and brings orders.

use std::time::Duration;

use axum::extract::ws::{Message, WebSocket};
use serde_json::json;
use tokio::sync::{broadcast::error::RecvError, watch};
use tokio::time::timeout;

use super::feed::{Subscription, Text};
use super::request::{self, Mailbox};

/// A browser that takes nothing for this long is let go.
const PATIENCE: Duration = Duration::from_secs(10);

/// Why a browser is no longer attended.
struct Gone;

/// Attends a browser until it goes.
pub(super) async fn attend(mut socket: WebSocket, mut subscription: Subscription, mailbox: &Mailbox) {
    let history = subscription.history();
    let mut outcome = send(&mut socket, &history).await;
    while outcome.is_ok() {
        outcome = tokio::select! {
            // Orders before pictures.
            biased;
            message = socket.recv() => match message {
                Some(Ok(message)) => answer(&mut socket, message, mailbox).await,
                Some(Err(_)) | None => Err(Gone),
            },
            orders = newest(&mut subscription.orders) => tell(&mut socket, orders).await,
            scene = newest(&mut subscription.scene) => tell(&mut socket, scene).await,
            events = subscription.events.recv() => match events {
                Ok(events) => send(&mut socket, &events).await,
                // What it was too slow for is in the recording.
                Err(RecvError::Lagged(_)) => Ok(()),
                Err(RecvError::Closed) => Err(Gone),
            },
            fleet = newest(&mut subscription.fleet) => tell(&mut socket, fleet).await,
        };
    }
}

/// What is so, once it has changed.
async fn newest(watch: &mut watch::Receiver<Option<Text>>) -> Result<Option<Text>, Gone> {
    watch.changed().await.map_err(|_| Gone)?;
    Ok(watch.borrow_and_update().clone())
}

async fn tell(socket: &mut WebSocket, message: Result<Option<Text>, Gone>) -> Result<(), Gone> {
    match message? {
        Some(text) => send(socket, &text).await,
        None => Ok(()),
    }
}

async fn send(socket: &mut WebSocket, text: &str) -> Result<(), Gone> {
    match timeout(PATIENCE, socket.send(Message::text(text))).await {
        Ok(Ok(())) => Ok(()),
        _ => Err(Gone),
    }
}

async fn answer(socket: &mut WebSocket, message: Message, mailbox: &Mailbox) -> Result<(), Gone> {
    let text = match &message {
        Message::Text(text) => text.as_str(),
        Message::Close(_) => return Err(Gone),
        Message::Binary(_) => "a binary message",
        Message::Ping(_) | Message::Pong(_) => return Ok(()),
    };
    let (tag, order) = request::read(text);
    let number = match order {
        Ok(order) => match mailbox.put(order) {
            Ok(given) => match given.await {
                Ok(given) => given.map_err(|stranger| stranger.to_string()),
                Err(_) => Err("the station is ending".to_owned()),
            },
            Err(why) => Err(why.to_owned()),
        },
        Err(why) => Err(why),
    };
    let reply = match number {
        Ok(id) => json!({ "type": "ordered", "tag": tag, "id": id }),
        Err(message) => json!({ "type": "error", "tag": tag, "message": message }),
    };
    send(socket, &reply.to_string()).await
}
