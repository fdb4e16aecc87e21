//! The messages of a recording, read within bounds whatever lengths the file claims.

use std::collections::BTreeMap;

use mcap::McapError;
use mcap::records::{Channel, MessageHeader, Record};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// A record, or a chunk of them, is at most so many times as long as the whole file: LZ4 makes nothing shorter.
const MOST_TIMES: usize = 255;

/// Reads messages one after another, each with the number of its channel.
pub struct Messages<'a> {
    rest: &'a [u8],
    reader: LinearReader,
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Channel>,
}

impl<'a> Messages<'a> {
    /// The messages of a file, which may have been cut short.
    pub fn of(file: &'a [u8]) -> Self {
        let most = file.len().saturating_mul(MOST_TIMES);
        let options = LinearReaderOptions::default().with_skip_end_magic(true).with_record_length_limit(most);
        let reader = LinearReader::new_with_options(options);
        Self { rest: file, reader, schemas: BTreeMap::new(), channels: BTreeMap::new() }
    }

    /// The channel of a message, if the file has told of it.
    pub fn topic(&self, message: &MessageHeader) -> Option<&str> {
        self.channels.get(&message.channel_id).map(|channel| channel.topic.as_str())
    }

    /// The name of a message's schema, if it has one.
    pub fn schema(&self, message: &MessageHeader) -> Option<&str> {
        let channel = self.channels.get(&message.channel_id)?;
        self.schemas.get(&channel.schema_id).map(String::as_str)
    }
}

impl Iterator for Messages<'_> {
    type Item = Result<(MessageHeader, Vec<u8>), McapError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let record = match self.reader.next_event()? {
                Ok(LinearReadEvent::ReadRequest(wanted)) => {
                    let (now, rest) = self.rest.split_at(wanted.min(self.rest.len()));
                    self.reader.insert(now.len()).copy_from_slice(now);
                    self.reader.notify_read(now.len());
                    self.rest = rest;
                    continue;
                }
                Ok(LinearReadEvent::Record { data, opcode }) => mcap::parse_record(opcode, data),
                Err(error) => return Some(Err(error)),
            };
            match record {
                Ok(Record::Schema { header, .. }) => {
                    self.schemas.insert(header.id, header.name);
                }
                Ok(Record::Channel(channel)) => {
                    self.channels.insert(channel.id, channel);
                }
                Ok(Record::Message { header, data }) => return Some(Ok((header, data.into_owned()))),
                Ok(_) => {}
                Err(error) => return Some(Err(error)),
            }
        }
    }
}
