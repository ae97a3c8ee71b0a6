//! Lines of bounded length from a socket.

use std::io;

use tokio::io::{AsyncBufReadExt, AsyncReadExt, BufReader};
use tokio::net::unix::OwnedReadHalf;

/// Maximum length of a request [byte].
pub(super) const MAX_LINE: usize = 16 << 10;

/// What a client has sent.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Line {
    /// A whole line.
    Whole(Vec<u8>),
    /// A line that is longer than [`MAX_LINE`].
    TooLong,
    /// The client has closed the connection.
    End,
}

/// Reads the next line.
///
/// # Errors
/// Those of the connection.
pub(super) async fn read_line(reader: &mut BufReader<OwnedReadHalf>) -> io::Result<Line> {
    let mut line = Vec::new();
    reader.take(MAX_LINE as u64 + 1).read_until(b'\n', &mut line).await?;
    if line.last() == Some(&b'\n') {
        line.pop();
        return Ok(Line::Whole(line));
    }
    Ok(if line.len() > MAX_LINE { Line::TooLong } else { Line::End })
}
