//! `tactflow sniff`: listens on a link, guesses the frames, and writes a description to start from.

mod binary;
mod heard;
mod parts;
mod replies;
mod text;

use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use tactflow_runtime::cli::{Shell, clap, duration};

use super::arguments::{may_replace, positive, write};
use crate::devices::link::{Address, Connection};
use heard::{Guess, Heard};

/// Listen to a pad, guess its frames, and write a description to start from
#[derive(clap::Parser)]
#[command(
    name = "sniff",
    after_help = "The link is that of the device `stream`: serial:PATH, tcp:HOST:PORT, udp:PORT, udp:HOST:PORT or ws:HOST:PORT/PATH.
Without --baud, the usual speeds of a serial port are tried one after the other.

Examples:
  tactflow sniff serial:/dev/ttyACM0
  tactflow sniff serial:/dev/ttyUSB0 --baud 2000000 -o my_pad.toml
  tactflow sniff serial:/dev/ttyACM0 --send hex:F0C400F1C5
  tactflow sniff serial:/dev/ttyUSB0 --baud 115200 --poll A --rate 30

Some pads start after a command (--send), and some answer a question with each frame (--poll).

Exit codes: 0 a guess was made; 1 no frames were found; 2 the link does not open, or the file cannot be written."
)]
pub(super) struct SniffArgs {
    /// Link to the pad
    link: String,
    /// Speed of a serial port [bits per second]
    #[arg(long)]
    baud: Option<u32>,
    /// What to send first: text, or bytes such as hex:F0C4
    #[arg(long, value_name = "BYTES")]
    send: Option<String>,
    /// What to send to ask for each frame: text, or bytes such as hex:F0C4
    #[arg(long, value_name = "BYTES")]
    poll: Option<String>,
    /// With --poll: how often to ask, in times per second
    #[arg(long, value_name = "HZ", value_parser = positive, default_value = "30", requires = "poll")]
    rate: f64,
    /// How long to listen at each speed
    #[arg(long = "for", value_name = "TIME", value_parser = duration, default_value = "3s")]
    time: f64,
    /// Write the description; replaces a description, but no other file
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// The usual speeds of serial ports, the most usual first.
const BAUDS: [u32; 10] = [115_200, 2_000_000, 1_000_000, 921_600, 460_800, 230_400, 500_000, 57_600, 38_400, 9_600];
/// Maximum number of bytes that are heard.
const MAX_BYTES: usize = 1 << 16;
/// Time without bytes that is a pause.
const PAUSE: Duration = Duration::from_millis(2);
/// Time without bytes after which an answer is complete.
const ANSWERED: Duration = Duration::from_millis(5);
/// Number of bytes that are shown.
const SHOWN_BYTES: usize = 64;

pub(super) fn run(args: SniffArgs, shell: &Shell) -> Result<u8, u8> {
    let address = Address::parse(&args.link).map_err(|message| shell.refuse(message))?;
    let words = Words::read(&args).map_err(|(message, help)| shell.refuse(format_args!("{message}\nhelp: {help}")))?;
    let bauds = match (&address, args.baud) {
        (Address::Serial(_), None) => &BAUDS[..],
        (_, baud) => &[baud.unwrap_or(0)],
    };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| shell.refuse(error))?;
    for baud in bauds {
        let time = Duration::from_secs_f64(args.time.clamp(0.1, 3600.0));
        let heard = runtime.block_on(listen(&address, *baud, &words, time));
        let heard = heard.map_err(|message| shell.refuse(format_args!("{address}: {message}")))?;
        let at = if *baud > 0 { format!(" at {baud} baud") } else { String::new() };
        shell.say(&format!("{} bytes in {:.1} s{at}{}", heard.bytes.len(), heard.seconds, dump(&heard.bytes)));
        let guess = text::guess(&heard).or_else(|| replies::guess(&heard)).or_else(|| binary::guess(&heard));
        if let Some(guess) = guess {
            let description = description(&guess, *baud, &args);
            guess.findings.iter().for_each(|finding| shell.say(&format!("- {finding}")));
            return save(&args, &description, shell);
        }
    }
    shell.error(
        "no frames were found\nhelp: press on the pad while it is heard, try `--baud`, `--send` or `--poll`, and listen longer \
         with `--for`",
    );
    Ok(1)
}

/// What is sent to a pad.
struct Words {
    start: Vec<u8>,
    /// What asks for a frame, and the time between two questions.
    poll: Option<(Vec<u8>, Duration)>,
}

impl Words {
    /// Reads the bytes of the arguments.
    ///
    /// # Errors
    /// What is wrong, and what to write instead.
    fn read(args: &SniffArgs) -> Result<Self, (String, String)> {
        let bytes = |text: &Option<String>| text.as_deref().map(crate::devices::stream::bytes_of).transpose();
        let period = Duration::from_secs_f64((1.0 / args.rate).min(60.0));
        Ok(Self { start: bytes(&args.send)?.unwrap_or_default(), poll: bytes(&args.poll)?.map(|poll| (poll, period)) })
    }
}

/// Listens on a link.
async fn listen(address: &Address, baud: u32, words: &Words, time: Duration) -> Result<Heard, String> {
    let mut connection = Connection::open(address, baud, None).await?;
    if !words.start.is_empty() {
        connection.send(&words.start).await?;
    }
    let (mut heard, mut buffer) = (Heard::default(), Vec::new());
    let end = Instant::now() + time;
    let (mut begin, mut last, mut ask_at) = (None, None::<Instant>, Instant::now());
    while heard.bytes.len() < MAX_BYTES {
        let limit = if words.poll.is_some() { end.min(ask_at) } else { end };
        let received = tokio::time::timeout_at(limit.into(), connection.receive(&mut buffer)).await;
        if let (Err(_), Some((question, period))) = (&received, &words.poll)
            && Instant::now() < end
        {
            // An answer that is still arriving belongs to the last question.
            let answering = last.map(|last| last + ANSWERED).filter(|free| *free > Instant::now());
            if answering.is_none() {
                heard.asks.push(heard.bytes.len());
                connection.send(question).await?;
            }
            ask_at = answering.unwrap_or_else(|| (ask_at + *period).max(Instant::now()));
            continue;
        }
        match received {
            Err(_) => break,
            Ok(Err(message)) if heard.bytes.is_empty() => return Err(message),
            Ok(Err(_)) => break,
            Ok(Ok(())) => {}
        }
        let now = Instant::now();
        begin = begin.or(Some(now));
        if last.is_none_or(|last| now - last > PAUSE) {
            heard.pauses.push(heard.bytes.len());
        }
        last = Some(now);
        heard.bytes.extend_from_slice(&buffer);
    }
    heard.seconds = begin.zip(last).map_or(0.0, |(begin, last)| (last - begin).as_secs_f64());
    Ok(heard)
}

/// The first bytes in hexadecimal digits and as text.
fn dump(bytes: &[u8]) -> String {
    let mut text = String::new();
    for line in bytes[..bytes.len().min(SHOWN_BYTES)].chunks(16) {
        let digits: Vec<String> = line.iter().map(|byte| format!("{byte:02X}")).collect();
        let letters = line.iter().map(|byte| if byte.is_ascii_graphic() { char::from(*byte) } else { '.' });
        let letters: String = letters.collect();
        // Writing to a string does not fail.
        let _ = write!(text, "\n  {:<47}  {letters}", digits.join(" "));
    }
    text
}

/// The text of the description.
fn description(guess: &Guess, baud: u32, args: &SniffArgs) -> String {
    let mut text =
        "# A pad that `tactflow sniff` has heard: check each key, and measure `pitch`\n[sensor]\n".to_owned();
    let mut line = |key: &str, value: &str, comment: &str| {
        let comment = if comment.is_empty() { String::new() } else { format!("  # {comment}") };
        let _ = writeln!(text, "{key} = {value}{comment}");
    };
    if baud > 0 {
        line("baud", &baud.to_string(), "");
    }
    for (key, sent) in [("start", &args.send), ("poll", &args.poll)] {
        sent.iter().for_each(|sent| line(key, &format!("{sent:?}"), ""));
    }
    guess.keys.iter().for_each(|(key, value, comment)| line(key, value, comment));
    line("pitch", "0.005", "[m]");
    text
}

fn save(args: &SniffArgs, description: &str, shell: &Shell) -> Result<u8, u8> {
    let Some(out) = &args.out else {
        shell.say(&format!("\n{description}"));
        return Ok(0);
    };
    let may_write = may_replace(out, "a description of a pad", |text| text.contains("[sensor]"));
    may_write.and_then(|()| write(out, description)).map_err(|message| shell.refuse(message))?;
    shell.say(&format!("wrote {}", out.display()));
    Ok(0)
}
