//! Scalars in TensorBoard's format: hand-written TFRecord frames around protobuf messages.

use super::crc32c::crc32c;
use super::log::LogRow;

/// Encodes an events file with all scalars of a log; `started_unix_s` is the Unix time at second 0 of the log.
///
/// Messages are TensorFlow's Event (wall_time 1, step 2, file_version 3, summary 5), Summary (value 1) and Value (tag 1,
/// simple_value 2).
pub fn tensorboard_events(rows: &[LogRow], started_unix_s: f64) -> Vec<u8> {
    let mut version = Vec::new();
    double(&mut version, 1, started_unix_s);
    bytes(&mut version, 3, b"brain.Event:2");
    let mut file = Vec::new();
    frame(&mut file, &version);
    for row in rows {
        let mut summary = Vec::new();
        for (tag, &value) in &row.scalars {
            let mut scalar = Vec::new();
            bytes(&mut scalar, 1, tag.as_bytes());
            float(&mut scalar, 2, value as f32);
            bytes(&mut summary, 1, &scalar);
        }
        let mut event = Vec::new();
        double(&mut event, 1, started_unix_s + row.seconds);
        varint(&mut event, 2 << 3);
        varint(&mut event, row.step);
        bytes(&mut event, 5, &summary);
        frame(&mut file, &event);
    }
    file
}

/// Writes a frame: length, its masked checksum, data, its masked checksum.
fn frame(file: &mut Vec<u8>, data: &[u8]) {
    let length = (data.len() as u64).to_le_bytes();
    file.extend(length);
    file.extend(masked(&length));
    file.extend(data);
    file.extend(masked(data));
}

fn masked(data: &[u8]) -> [u8; 4] {
    let rotated = crc32c(data).rotate_right(15);
    rotated.wrapping_add(0xA282_EAD8).to_le_bytes()
}

fn varint(message: &mut Vec<u8>, mut value: u64) {
    while value > 0x7F {
        message.push(value as u8 | 0x80);
        value >>= 7;
    }
    message.push(value as u8);
}

fn double(message: &mut Vec<u8>, field: u64, value: f64) {
    varint(message, field << 3 | 1);
    message.extend(value.to_le_bytes());
}

fn float(message: &mut Vec<u8>, field: u64, value: f32) {
    varint(message, field << 3 | 5);
    message.extend(value.to_le_bytes());
}

fn bytes(message: &mut Vec<u8>, field: u64, value: &[u8]) {
    varint(message, field << 3 | 2);
    varint(message, value.len() as u64);
    message.extend(value);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bytes that TensorFlow's protobuf and TFRecord writers give, derived by hand; Python's tensorboard reads them.
    #[test]
    fn one_scalar_by_hand() {
        let row = LogRow {
            step: 300,
            seconds: 2.0,
            scalars: [("loss".to_owned(), 0.5)].into(),
        };
        let file = tensorboard_events(&[row], 1.0);
        let version = 9 + 2 + 13;
        assert_eq!(file[..8], (version as u64).to_le_bytes());
        let event = &file[8 + 4 + version + 4..];
        let data = [
            &[0x09][..],
            &3f64.to_le_bytes(),
            &[0x10, 0xAC, 0x02, 0x2A, 13, 0x0A, 11, 0x0A, 4],
            b"loss",
            &[0x15],
            &0.5f32.to_le_bytes(),
        ]
        .concat();
        assert_eq!(event[..8], (data.len() as u64).to_le_bytes());
        assert_eq!(event[12..12 + data.len()], data);
        assert_eq!(event[12 + data.len()..], masked(&data));
    }
}
