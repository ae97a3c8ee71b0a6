//! A WebSocket connection to a device: each message is one datagram.

use futures_util::{SinkExt, StreamExt};
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;
use tokio_tungstenite::tungstenite::{Bytes, Message};
use tokio_tungstenite::{WebSocketStream, client_async_with_config};

use super::RECEIVED_BYTES;

/// An open connection.
pub(crate) struct WebSocket {
    stream: WebSocketStream<TcpStream>,
}

impl WebSocket {
    pub(super) async fn open(peer: &str) -> Result<Self, String> {
        let host = peer.split('/').next().unwrap_or_default();
        let stream = TcpStream::connect(host).await.map_err(|error| error.to_string())?;
        stream.set_nodelay(true).map_err(|error| error.to_string())?;
        let config =
            WebSocketConfig::default().max_message_size(Some(RECEIVED_BYTES)).max_frame_size(Some(RECEIVED_BYTES));
        let shaken = client_async_with_config(format!("ws://{peer}"), stream, Some(config)).await;
        let (stream, _) = shaken.map_err(|error| format!("the peer is no WebSocket server: {error}"))?;
        Ok(Self { stream })
    }

    pub(super) async fn receive(&mut self, buffer: &mut Vec<u8>) -> Result<(), String> {
        loop {
            let message = match self.stream.next().await {
                Some(Ok(message)) => message,
                Some(Err(error)) => return Err(error.to_string()),
                None => return Err("the peer has closed the connection".to_owned()),
            };
            match message {
                Message::Binary(_) | Message::Text(_) => {
                    buffer.clear();
                    buffer.extend_from_slice(&message.into_data());
                    return Ok(());
                }
                Message::Close(_) => return Err("the peer has closed the connection".to_owned()),
                // A ping is answered by the library.
                Message::Ping(_) | Message::Pong(_) | Message::Frame(_) => {}
            }
        }
    }

    pub(super) async fn send(&mut self, bytes: &[u8]) -> Result<(), String> {
        let message = match std::str::from_utf8(bytes) {
            Ok(text) => Message::text(text),
            Err(_) => Message::Binary(Bytes::copy_from_slice(bytes)),
        };
        self.stream.send(message).await.map_err(|error| error.to_string())
    }
}
