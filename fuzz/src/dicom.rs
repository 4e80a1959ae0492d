//! A minimal DICOM file around a compressed frame.

/// Returns a CT slice with transfer syntax `syntax`: `size` columns and rows, 8 or 16 bits by the parity of `bits`, one fragment.
pub fn dicom_file(syntax: &str, size: [u8; 2], bits: u8, fragment: &[u8]) -> Vec<u8> {
    let [columns, rows] = size.map(|n| u16::from(n.max(1)).to_le_bytes());
    let bits = if bits % 2 == 0 { 16_u16 } else { 8 };
    let number = |n: u16| n.to_le_bytes();
    let mut file = [&[0; 128], &b"DICM"[..]].concat();
    let elements: [(u16, u16, &[u8; 2], &[u8]); 16] = [
        (0x0002, 0x0002, b"UI", b"1.2.840.10008.5.1.4.1.1.2"),
        (0x0002, 0x0010, b"UI", syntax.as_bytes()),
        (0x0008, 0x0060, b"CS", b"CT"),
        (0x0018, 0x0050, b"DS", b"1"),
        (0x0020, 0x000e, b"UI", b"1"),
        (0x0020, 0x0032, b"DS", b"0\\0\\0"),
        (0x0020, 0x0037, b"DS", b"1\\0\\0\\0\\1\\0"),
        (0x0028, 0x0002, b"US", &number(1)),
        (0x0028, 0x0004, b"CS", b"MONOCHROME2"),
        (0x0028, 0x0010, b"US", &rows),
        (0x0028, 0x0011, b"US", &columns),
        (0x0028, 0x0030, b"DS", b"1\\1"),
        (0x0028, 0x0100, b"US", &number(bits)),
        (0x0028, 0x0101, b"US", &number(bits)),
        (0x0028, 0x0102, b"US", &number(bits - 1)),
        (0x0028, 0x0103, b"US", &number(0)),
    ];
    for (group, element, kind, value) in elements {
        put(&mut file, group, element, kind, value);
    }
    file.extend(b"\xe0\x7f\x10\x00OB\0\0\xff\xff\xff\xff\xfe\xff\x00\xe0\0\0\0\0");
    file.extend(b"\xfe\xff\x00\xe0");
    file.extend((fragment.len() as u32).to_le_bytes());
    file.extend(fragment);
    file.extend(b"\xfe\xff\xdd\xe0\0\0\0\0");
    file
}

fn put(file: &mut Vec<u8>, group: u16, element: u16, kind: &[u8; 2], value: &[u8]) {
    let padded = value.len().next_multiple_of(2);
    file.extend(group.to_le_bytes());
    file.extend(element.to_le_bytes());
    file.extend(kind);
    file.extend((padded as u16).to_le_bytes());
    file.extend(value);
    if padded > value.len() {
        file.push(if kind == b"UI" { 0 } else { b' ' });
    }
}
