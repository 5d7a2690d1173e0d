//! Packets at full speed and their durations (USB 2.0 chapters 7 and 8). Bit stuffing is left out:
//! it lengthens a packet by a sixth at most.

/// Largest packet of a bulk, interrupt or control endpoint, bytes (USB 2.0 5.5.3, 5.7.3, 5.8.3).
pub(crate) const LARGEST_PACKET: usize = 64;
/// Length of a frame (USB 2.0 7.1.12).
pub(crate) const FRAME_PS: u64 = 1_000_000_000;

/// Bits of a token: SYNC, PID, address, endpoint, CRC and end of packet (USB 2.0 8.4.1).
const TOKEN_BITS: u64 = 8 + 8 + 7 + 4 + 5 + 3;
/// Bits of a handshake: SYNC, PID and end of packet (USB 2.0 8.4.5).
const HANDSHAKE_BITS: u64 = 8 + 8 + 3;
/// Bits of a data packet besides its data: SYNC, PID, CRC and end of packet (USB 2.0 8.4.4).
const DATA_BITS: u64 = 8 + 8 + 16 + 3;
/// Minimum gap between two packets of the host (USB 2.0 7.1.18.1).
const GAP_BITS: u64 = 2;
/// Longest response time of a device with a detachable cable, in half bits (USB 2.0 7.1.18.1, 6.5
/// bit times).
const TURNAROUND_HALF_BITS: u64 = 13;
/// Response time after which the host stops waiting (USB 2.0 7.1.19.1, 16 to 18 bit times).
const TIMEOUT_BITS: u64 = 18;
/// Idle time required before a start of frame (USB 2.0 11.2.5, EOF1).
const END_OF_FRAME_BITS: u64 = 32;

/// Duration of `half_bits` half bits, ps: half a bit at 12 Mbit/s lasts a 24th of a microsecond.
const fn half_bits_ps(half_bits: u64) -> u64 {
    half_bits * 1_000_000 / 24
}

const fn bits_ps(bits: u64) -> u64 {
    half_bits_ps(2 * bits)
}

/// First part of a transaction, sent by the host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Transaction {
    /// Address of the device, 0 to 127.
    pub(crate) address: u8,
    /// Number of the endpoint, 0 to 15.
    pub(crate) endpoint: u8,
    pub(crate) kind: TransactionKind,
}

/// Kind of a transaction, by its token (USB 2.0 8.5).
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum TransactionKind {
    Setup([u8; 8]),
    /// Data of the host, with PID DATA1 or DATA0.
    Out {
        data1: bool,
        data: Vec<u8>,
    },
    In,
}

/// Answer of the device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Reply {
    /// No answer.
    Silence,
    Nak,
    Stall,
    /// The device accepts the host's data.
    Ack,
    /// Data for the host, with PID DATA1 or DATA0.
    Data {
        data1: bool,
        data: Vec<u8>,
    },
}

impl Transaction {
    /// Time from the end of the token to the end of the last packet.
    pub(crate) fn time_ps(&self, reply: &Reply) -> u64 {
        let handshake_ps = half_bits_ps(TURNAROUND_HALF_BITS) + bits_ps(HANDSHAKE_BITS);
        let sent_ps = match &self.kind {
            TransactionKind::Setup(data) => data_ps(data.len()),
            TransactionKind::Out { data, .. } => data_ps(data.len()),
            TransactionKind::In => 0,
        };
        match reply {
            Reply::Silence => sent_ps + bits_ps(TIMEOUT_BITS),
            Reply::Nak | Reply::Stall | Reply::Ack => sent_ps + handshake_ps,
            Reply::Data { data, .. } => {
                half_bits_ps(TURNAROUND_HALF_BITS) - bits_ps(GAP_BITS)
                    + data_ps(data.len())
                    + handshake_ps
            }
        }
    }

    /// Longest possible time from the end of the token.
    pub(crate) fn longest_ps(&self) -> u64 {
        let received_ps = match self.kind {
            TransactionKind::In => data_ps(LARGEST_PACKET) + half_bits_ps(TURNAROUND_HALF_BITS),
            _ => 0,
        };
        received_ps + self.time_ps(&Reply::Nak)
    }
}

/// Duration of a data packet with the gap before it.
const fn data_ps(bytes: usize) -> u64 {
    bits_ps(GAP_BITS + DATA_BITS + 8 * bytes as u64)
}

/// Duration of a token with the gap before it.
pub(crate) const fn token_ps() -> u64 {
    bits_ps(GAP_BITS + TOKEN_BITS)
}

/// Duration of a start of frame, which is as long as a token.
pub(crate) const fn start_of_frame_ps() -> u64 {
    bits_ps(TOKEN_BITS)
}

/// Time at the end of a frame in which no transaction may still run.
pub(crate) const fn end_of_frame_ps() -> u64 {
    bits_ps(END_OF_FRAME_BITS)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn transaction(kind: TransactionKind) -> Transaction {
        Transaction {
            address: 1,
            endpoint: 1,
            kind,
        }
    }

    /// USB 2.0 table 5-9: at most 19 bulk transactions of 64 bytes fit into a frame.
    #[test]
    fn nineteen_bulk_packets_of_64_bytes_fit_into_a_frame_and_not_many_more() {
        let data = vec![0; 64];
        let reply = Reply::Data {
            data1: false,
            data: data.clone(),
        };
        let of_in = transaction(TransactionKind::In).time_ps(&reply);
        let of_out = transaction(TransactionKind::Out { data1: false, data }).time_ps(&Reply::Ack);
        for time_ps in [of_in, of_out] {
            let whole_ps = token_ps() + time_ps;
            let count = (FRAME_PS - start_of_frame_ps() - end_of_frame_ps()) / whole_ps;
            assert!((19..=19).contains(&count), "{count}");
        }
    }
}
