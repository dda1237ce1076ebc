//! The codec of messages and rows for the link over NATS.

use bottega_agents::codec::Codec;

use super::{error::WireError, layout, message::ContentRecord, row::ValueRecord};
use crate::{
    FarmContent, FarmValue,
    contents::{LANGUAGE, ONTOLOGY, protocol},
};

/// The codec of the farm's messages and rows.
#[derive(Clone, Copy, Debug, Default)]
pub struct FarmCodec;

impl Codec for FarmCodec {
    type Content = FarmContent;
    type Value = FarmValue;
    type Error = WireError;

    fn words(&self) -> &'static [&'static str] {
        &[LANGUAGE, ONTOLOGY, protocol::CONTRACT_NET, protocol::REQUEST, protocol::SUBSCRIBE]
    }

    fn write_content(&self, content: &FarmContent, bytes: &mut Vec<u8>) {
        layout::put(&ContentRecord::from(content), bytes);
    }

    fn read_content(&self, bytes: &[u8]) -> Result<FarmContent, WireError> {
        layout::read::<ContentRecord<'_>>("the content of a message", bytes)?.try_into()
    }

    fn write_value(&self, value: &FarmValue, bytes: &mut Vec<u8>) {
        layout::put(&ValueRecord::from(value), bytes);
    }

    fn read_value(&self, bytes: &[u8]) -> Result<FarmValue, WireError> {
        layout::read::<ValueRecord<'_>>("a row", bytes)?.try_into()
    }
}
