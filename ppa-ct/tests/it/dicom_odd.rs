//! Unusual DICOM files and folders are read correctly or refused with the reason.

use std::fs;
use std::path::Path;

use dicom_core::value::DataSetSequence;
use dicom_core::{DataElement, PrimitiveValue, Tag, VR};
use dicom_dictionary_std::{tags, uids};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};
use ppa_ct::{ReadError, ReadOptions, Scan, WarningCode, read, read_with};

use crate::series::{SliceSpec, write_series};

fn slice(z: f64) -> SliceSpec {
    SliceSpec::axial([4, 3], z, |i, j| (10 * j + i) as i16 - 1000)
}

fn put(object: &mut InMemDicomObject, tag: Tag, vr: VR, value: impl Into<PrimitiveValue>) {
    object.put(DataElement::new(tag, vr, value.into()));
}

fn chosen(folder: &Path, series: &str) -> Result<Scan, ReadError> {
    let options = ReadOptions {
        series: Some(series.parse().unwrap()),
        ..ReadOptions::default()
    };
    read_with(folder, &options)
}

/// Dose sheets and other pages have the modality CT.
#[test]
fn an_image_that_is_no_slice_refuses_its_own_series_only() {
    type Odd = fn(&mut InMemDicomObject);
    let odd: [(Odd, &str); 5] = [
        (
            |o| drop(o.take(tags::IMAGE_POSITION_PATIENT)),
            "lacks ImagePositionPatient",
        ),
        (
            |o| put(o, tags::PHOTOMETRIC_INTERPRETATION, VR::CS, "RGB"),
            "PhotometricInterpretation is RGB",
        ),
        (
            |o| put(o, tags::PHOTOMETRIC_INTERPRETATION, VR::CS, "PALETTE COLOR"),
            "PhotometricInterpretation is PALETTE COLOR",
        ),
        (
            |o| put(o, tags::PHOTOMETRIC_INTERPRETATION, VR::CS, "DOE JOHN"),
            "PhotometricInterpretation is (no DICOM term)",
        ),
        (
            |o| put(o, tags::SAMPLES_PER_PIXEL, VR::US, 3_u16),
            "SamplesPerPixel is 3",
        ),
    ];
    for (change, reason) in odd {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let mut slices = [0.0, 1.0, 2.0].map(slice);
        write_series(folder, &slices);
        let alone = read(folder).unwrap();
        let page = SliceSpec {
            series: 999,
            change,
            ..slice(0.0)
        };
        page.write(&folder.join("A page"));

        let scan = chosen(folder, "3").unwrap();
        assert_eq!(scan.volume, alone.volume, "{reason}");
        let refused = scan.series[1].refused.as_deref().unwrap();
        assert!(refused.starts_with(reason), "{refused}");
        let error = read(folder).unwrap_err();
        assert!(matches!(error, ReadError::SeveralSeries { .. }), "{error}");
        assert!(error.to_string().contains(reason), "{error}");
        let error = chosen(folder, "999").unwrap_err().to_string();
        assert!(
            error.contains("A page") && error.contains(reason),
            "{error}"
        );

        // Among the slices of a series, it may be one whose absence leaves a gap.
        slices[1].change = change;
        write_series(folder, &slices);
        let error = chosen(folder, "3").unwrap_err().to_string();
        assert!(error.contains(reason), "{error}");
    }
}

#[test]
fn a_directory_of_the_medium_does_not_hide_the_folders_below() {
    let folder = tempfile::tempdir().unwrap();
    let below = folder.path().join("DICOM/A");
    fs::create_dir_all(&below).unwrap();
    write_series(&below, &[0.0, 1.0].map(slice));
    let class = "1.2.840.10008.1.3.10"; // Media Storage Directory
    let mut directory = InMemDicomObject::new_empty();
    put(&mut directory, tags::FILE_SET_ID, VR::CS, "DISC");
    let meta = FileMetaTableBuilder::new()
        .transfer_syntax(uids::EXPLICIT_VR_LITTLE_ENDIAN)
        .media_storage_sop_class_uid(class)
        .media_storage_sop_instance_uid("2.25.1");
    let directory = directory.with_meta(meta).unwrap();
    directory
        .write_to_file(folder.path().join("DICOMDIR"))
        .unwrap();
    let scan = read(folder.path()).unwrap();
    assert_eq!(scan.volume, read(&below).unwrap().volume);
    assert_eq!(scan.warnings[0].code, WarningCode::NonImagesDropped);
}

#[test]
fn units_are_read_as_they_are_spelt() {
    let unit = |change| {
        let folder = tempfile::tempdir().unwrap();
        let slices = [0.0, 1.0].map(|z| SliceSpec { change, ..slice(z) });
        write_series(folder.path(), &slices);
        let force = ReadOptions {
            force: true,
            ..ReadOptions::default()
        };
        let forced = read_with(folder.path(), &force).unwrap();
        (read(folder.path()).is_ok(), forced.acquisition.unit)
    };
    let words = |o: &mut _| put(o, tags::RESCALE_TYPE, VR::LO, "Hounsfield units");
    assert_eq!(unit(words), (true, None));
    assert_eq!(
        unit(|o| put(o, tags::RESCALE_TYPE, VR::LO, "HOUNSFIELD")),
        (true, None)
    );
    let iodine = |o: &mut _| put(o, tags::RESCALE_TYPE, VR::LO, "mg/ml");
    assert_eq!(unit(iodine), (false, Some("mg/ml")));
    let unknown = |o: &mut _| put(o, tags::RESCALE_TYPE, VR::LO, "Doe, John");
    assert_eq!(unit(unknown), (false, Some("another unit")));
}

/// Two frames of nine pixels: the middle word contains the last pixel of one and the first of the other.
#[test]
fn odd_frames_in_big_endian_words_are_separated() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frames.dcm");
    let change = |o: &mut InMemDicomObject| {
        put(o, tags::NUMBER_OF_FRAMES, VR::IS, "2");
        for (tag, number) in [
            (tags::BITS_ALLOCATED, 8_u16),
            (tags::BITS_STORED, 8),
            (tags::HIGH_BIT, 7),
        ] {
            put(o, tag, VR::US, number);
        }
        let words = (0..18_u16).step_by(2).map(|n| n | (n + 1) << 8);
        put(
            o,
            tags::PIXEL_DATA,
            VR::OW,
            PrimitiveValue::U16(words.collect()),
        );
        let item = |elements: Vec<DataElement<InMemDicomObject>>| {
            InMemDicomObject::from_element_iter(elements)
        };
        let sequence = |tag, items: Vec<InMemDicomObject>| {
            DataElement::new(tag, VR::SQ, DataSetSequence::from(items))
        };
        let frames = ["-10\\20\\0", "-10\\20\\2"].map(|position| {
            let place = DataElement::new(
                tags::IMAGE_POSITION_PATIENT,
                VR::DS,
                PrimitiveValue::from(position),
            );
            item(vec![sequence(
                tags::PLANE_POSITION_SEQUENCE,
                vec![item(vec![place])],
            )])
        });
        o.put(sequence(
            tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE,
            frames.to_vec(),
        ));
    };
    let frames = SliceSpec {
        size: [3, 3],
        signed: false,
        syntax: "1.2.840.10008.1.2.2",
        change,
        ..slice(0.0)
    };
    frames.write(&path);
    let volume = read(&path).unwrap().volume;
    assert_eq!(volume.grid().size(), [3, 3, 2]);
    assert_eq!(*volume.hu(), (0..18).map(|n| n as f32).collect::<Vec<_>>());
}

/// If parsed for each frame and attribute, this would take minutes.
#[test]
fn groups_that_all_frames_share_are_parsed_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frames.dcm");
    let change = |o: &mut InMemDicomObject| {
        put(o, tags::NUMBER_OF_FRAMES, VR::IS, "20000");
        let sequence = |tag, items: Vec<InMemDicomObject>| {
            DataElement::new(tag, VR::SQ, DataSetSequence::from(items))
        };
        let mut place = InMemDicomObject::new_empty();
        put(&mut place, tags::IMAGE_POSITION_PATIENT, VR::DS, "1\\2\\3");
        for n in 0x1000..0xf000 {
            put(&mut place, Tag(0x29, n), VR::LO, "x");
        }
        let mut shared = InMemDicomObject::new_empty();
        shared.put(sequence(tags::PLANE_POSITION_SEQUENCE, vec![place]));
        o.put(sequence(
            tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE,
            vec![shared],
        ));
        let empty = vec![InMemDicomObject::new_empty(); 20_000];
        o.put(sequence(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE, empty));
    };
    SliceSpec {
        change,
        ..slice(0.0)
    }
    .write(&path);
    let start = std::time::Instant::now();
    let error = read(&path).unwrap_err();
    assert!(matches!(error, ReadError::PixelCount { .. }), "{error}");
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

#[test]
fn slices_beside_the_line_and_endless_gaps_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let fill = ReadOptions {
        fill_gaps: true,
        ..ReadOptions::default()
    };
    write_series(folder.path(), &[0.0, 0.01, 1000.0].map(slice));
    match read_with(folder.path(), &fill).unwrap_err() {
        ReadError::TooManyGaps {
            slices: 3,
            needed: 100_001.0,
            most: 24,
            ..
        } => {}
        error => panic!("{error}"),
    }
    // 3 mm to the side and back again, by steps of the same length.
    let mut slices = [0.0, 1.0, 2.0, 3.0, 4.0].map(slice);
    for k in [1, 3] {
        slices[k].position.x += 3.0;
    }
    write_series(folder.path(), &slices);
    for options in [ReadOptions::default(), fill] {
        let error = read_with(folder.path(), &options).unwrap_err().to_string();
        assert!(
            error.contains("slice 3 is 3.000 mm off the line"),
            "{error}"
        );
    }
}

/// A file whose pixels are one fragment of JPEG-LS.
fn write_jpeg_ls(path: &Path, slice: &SliceSpec, stream: &[u8]) {
    slice.write(path);
    let bytes = fs::read(path).unwrap();
    let place = |bytes: &[u8], part: &[u8]| bytes.windows(part.len()).rposition(|w| w == part);
    let pixels = place(&bytes, &[0xe0, 0x7f, 0x10, 0]).unwrap();
    let mut bytes = bytes[..pixels].to_vec();
    let plain = b"\x14\x001.2.840.10008.1.2.1\0";
    let at = place(&bytes, plain).unwrap();
    bytes.splice(at..at + plain.len(), *b"\x16\x001.2.840.10008.1.2.4.80");
    bytes.extend(b"\xe0\x7f\x10\0OB\0\0\xff\xff\xff\xff\xfe\xff\0\xe0\0\0\0\0\xfe\xff\0\xe0");
    bytes.extend((stream.len() as u32).to_le_bytes());
    bytes.extend(stream);
    bytes.extend(b"\xfe\xff\xdd\xe0\0\0\0\0");
    fs::write(path, bytes).unwrap();
}

/// Repeated lines take a bit each; a larger claimed size is refused before memory is reserved for it.
#[test]
fn blank_slices_are_read_however_well_they_pack() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("blank.dcm");
    let blank = |side: u16| {
        let [high, low] = side.to_be_bytes();
        let frame = [0xff, 0xf7, 0, 11, 16, high, low, high, low, 1, 1, 0x11, 0];
        let scan = [0xff, 0xda, 0, 8, 1, 1, 0, 0, 0, 0];
        // Only ones, which continue runs; after 0xff a zero is stuffed.
        let ones = [0xff, 0x7f].repeat(usize::from(side) / 15 + 5);
        let stream = [&[0xff, 0xd8], &frame[..], &scan, &ones, &[0xff, 0xd9]].concat();
        let slice = SliceSpec {
            size: [side, side],
            ..slice(0.0)
        };
        write_jpeg_ls(&path, &slice, &stream[..stream.len() / 2 * 2]);
        stream.len() as u64
    };
    let packed = blank(2048);
    assert!(2 * 2048 * 2048 > 20_000 * packed, "{packed}");
    let volume = read(&path).unwrap().volume;
    assert_eq!(volume.grid().size(), [2048, 2048, 1]);
    assert_eq!(
        volume.values().iter().fold(0.0, |sum, v| sum + v.abs()),
        0.0
    );
    blank(u16::MAX);
    let bomb = read(&path).unwrap_err();
    assert!(matches!(bomb, ReadError::PixelCount { .. }), "{bomb}");
}

/// Found in public test images: an application title of 18 characters, where 16 are allowed.
#[test]
fn a_mistake_in_the_meta_group_does_not_stop_the_reading() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("slice.dcm");
    SliceSpec::axial([4, 3], 0.0, |i, _| i as i16 - 1000).write(&path);
    let right = read(&path).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    let length = u32::from_le_bytes(bytes[140..144].try_into().unwrap());
    let end = 144 + length as usize;
    let title = [b"\x02\0\x16\0AE\x12\0".as_slice(), &[b' '; 18]].concat();
    bytes.splice(end..end, title.iter().copied());
    bytes[140..144].copy_from_slice(&(length + title.len() as u32).to_le_bytes());
    std::fs::write(&path, &bytes).unwrap();
    assert_eq!(read(&path).unwrap(), right);
}

#[test]
fn what_is_no_scan_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing.nii");
    assert!(matches!(read(&missing), Err(ReadError::Io { .. })));
    assert!(matches!(
        read(folder.path()),
        Err(ReadError::NoDicom { files: 0, .. })
    ));
    let text = folder.path().join("notes.txt");
    std::fs::write(&text, "not a scan").unwrap();
    std::fs::write(folder.path().join("leg.nii.gz"), "").unwrap();
    let error = read(folder.path()).unwrap_err().to_string();
    let said = format!(
        "including subfolders); name the file {} itself",
        folder.path().join("leg.nii.gz").display()
    );
    assert!(error.contains(&said), "{error}");
    let error = read(&text).unwrap_err().to_string();
    assert!(
        error.contains("notes.txt") && error.contains(".nii.gz"),
        "{error}"
    );
}
