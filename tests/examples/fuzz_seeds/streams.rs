//! Compressed frames for which no encoder is available.

/// 8 x 8 pixels of 16 bits, with two runs for each byte.
pub fn rle() -> Vec<u8> {
    let segment = [0xc1, 3, 0x80]; // 64 times 3, and a code without meaning
    let starts = [2_u32, 64, 64 + segment.len() as u32];
    let mut stream: Vec<u8> = starts.iter().flat_map(|n| n.to_le_bytes()).collect();
    stream.resize(64, 0);
    stream.extend([segment, segment].concat());
    stream
}

/// The example of ISO/IEC 14495-1, section H.3: 4 x 4 pixels of 8 bits.
pub fn jpeg_ls() -> Vec<u8> {
    const STREAM: &str = "ffd8fff7000b080004000401011100ffda0008010100000000\
        c000006c80208e01c00000574000006ee6000001bc18000005d800009160ffd9";
    let byte = |at| u8::from_str_radix(&STREAM[at..at + 2], 16).expect("two digits");
    (0..STREAM.len()).step_by(2).map(byte).collect()
}

/// A JPEG 2000 codestream of one tile with `side` x `side` pixels of 8 bits, whose only packet is empty.
pub fn jpeg_2000(side: u32) -> Vec<u8> {
    let segment = |marker: u8, body: &[u8]| {
        let length = (body.len() as u16 + 2).to_be_bytes();
        [&[0xff, marker], &length[..], body].concat()
    };
    let sizes = [side, side, 0, 0, side, side, 0, 0].map(u32::to_be_bytes);
    [
        vec![0xff, 0x4f],
        segment(
            0x51,
            &[&[0; 2], sizes.as_flattened(), &[0, 1, 7, 1, 1]].concat(),
        ),
        segment(0x52, &[0, 0, 0, 1, 0, 0, 4, 4, 0, 1]),
        segment(0x5c, &[0x40, 0x40]),
        segment(0x90, &[0, 0, 0, 0, 0, 15, 0, 1]),
        vec![0xff, 0x93, 0, 0xff, 0xd9],
    ]
    .concat()
}
