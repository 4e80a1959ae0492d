//! Files that point elsewhere: links next to headers, and directories of a medium.

use std::fs;
use std::path::Path;

use dicom_core::value::DataSetSequence;
use dicom_core::{DataElement, PrimitiveValue, VR};
use dicom_dictionary_std::{tags, uids};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};
use ppa_ct::{ReadError, WarningCode, read, write_meta_image};

use crate::nrrd::header;
use crate::series::{SliceSpec, write_series};
use crate::text_headers::voxels;
use crate::volumes::small;

/// A header may name anybody's file.
#[cfg(unix)]
#[test]
fn a_link_beside_a_header_does_not_lead_out_of_its_folder() {
    use std::os::unix::fs::symlink;
    let [elsewhere, folder] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let (elsewhere, folder) = (elsewhere.path(), folder.path());
    let nrrd = folder.join("v.nhdr");
    fs::write(&nrrd, header(&["data file: v.raw"]) + "\n").unwrap();
    write_meta_image(&folder.join("m.mhd"), &small()).unwrap();
    let files = fs::read_dir(folder)
        .unwrap()
        .map(|file| file.unwrap().path());
    let raw = files
        .into_iter()
        .find(|file| file.extension().is_some_and(|e| e == "zraw"))
        .unwrap();
    let meta_voxels = fs::read(&raw).unwrap();
    for (header, data, bytes) in [
        (&nrrd, folder.join("v.raw"), voxels()),
        (&folder.join("m.mhd"), raw, meta_voxels),
    ] {
        let name = data.file_name().unwrap();
        let _ = fs::remove_file(&data);
        fs::write(elsewhere.join(name), &bytes).unwrap();
        symlink(elsewhere.join(name), &data).unwrap();
        let error = read(header).unwrap_err();
        assert!(matches!(error, ReadError::Header { .. }), "{error}");
        assert!(
            error.to_string().contains("link to another folder"),
            "{error}"
        );

        fs::remove_file(&data).unwrap();
        fs::write(folder.join("other"), &bytes).unwrap();
        symlink("other", &data).unwrap();
        read(header).unwrap();
    }
}

fn slice(z: f64) -> SliceSpec {
    SliceSpec::axial([4, 3], z, |i, j| (10 * j + i) as i16 - 1000)
}

/// Writes a DICOMDIR that lists files.
fn write_directory(path: &Path, ids: &[&str]) {
    let records = ids.iter().map(|id| {
        let id = PrimitiveValue::from(*id);
        InMemDicomObject::from_element_iter([DataElement::new(
            tags::REFERENCED_FILE_ID,
            VR::CS,
            id,
        )])
    });
    let records = DataSetSequence::from(records.collect::<Vec<_>>());
    let mut directory = InMemDicomObject::new_empty();
    directory.put(DataElement::new(
        tags::DIRECTORY_RECORD_SEQUENCE,
        VR::SQ,
        records,
    ));
    let meta = FileMetaTableBuilder::new()
        .transfer_syntax(uids::EXPLICIT_VR_LITTLE_ENDIAN)
        .media_storage_sop_class_uid(uids::MEDIA_STORAGE_DIRECTORY_STORAGE)
        .media_storage_sop_instance_uid("2.25.1");
    let directory = directory.with_meta(meta).unwrap();
    directory.write_to_file(path).unwrap();
}

#[test]
fn a_directory_of_the_medium_leads_to_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let directory = folder.path().join("DICOMDIR");
    let below = folder.path().join("DICOM/A");
    fs::create_dir_all(&below).unwrap();
    write_series(&below, &[0.0, 1.0, 2.0].map(slice));
    let alone = read(&below).unwrap();
    let names = [13, 7932, 5844].map(|n| format!("DICOM\\A\\IM{n:05}"));
    let mut names: Vec<_> = names.iter().map(String::as_str).collect();
    write_directory(&directory, &names);
    for path in [&directory, folder.path()] {
        let scan = read(path).unwrap();
        assert_eq!(scan.volume, alone.volume, "{}", path.display());
        assert_eq!(scan.warnings[0].code, WarningCode::NonImagesDropped);
    }
    // An image next to the directory hides none of its files.
    slice(3.0).write(&folder.path().join("IMAGE"));
    assert_eq!(read(folder.path()).unwrap().volume.grid().size(), [4, 3, 4]);
    fs::remove_file(folder.path().join("IMAGE")).unwrap();

    names.push("DICOM\\A\\MISSING");
    write_directory(&directory, &names);
    let scan = read(&directory).unwrap();
    assert_eq!(scan.volume, alone.volume);
    let codes: Vec<_> = scan.warnings.iter().map(|w| w.code).collect();
    assert!(codes.contains(&WarningCode::FilesMissing), "{codes:?}");

    // Files that were emptied are no less missing, whether they are listed or named as slices.
    let damaged = |path: &Path| {
        let scan = read(path).unwrap();
        assert_eq!(scan.volume, alone.volume);
        let texts = scan.warnings.iter().map(|warning| &*warning.text);
        texts
            .filter(|text| text.contains("empty or damaged"))
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    assert_eq!(damaged(&below), [""; 0]);
    fs::write(below.join("MISSING"), "").unwrap();
    fs::write(below.join("IM9.dcm"), [0; 200]).unwrap();
    fs::write(below.join("._IM9.dcm"), "").unwrap();
    let text = "1 file named or listed as DICOM, but empty or damaged: slices may be missing";
    assert_eq!(damaged(&directory), [text]);
    assert_eq!(damaged(&below), [text]);

    write_directory(&directory, &["GONE"]);
    let error = read(&directory).unwrap_err();
    assert!(
        matches!(error, ReadError::EmptyDirectory { missing: 1, .. }),
        "{error}"
    );
    assert_eq!(read(folder.path()).unwrap().volume, alone.volume);
}

#[test]
fn a_directory_of_the_medium_does_not_lead_out_of_its_folder() {
    let outside = tempfile::tempdir().unwrap();
    let folder = outside.path().join("medium");
    fs::create_dir(&folder).unwrap();
    slice(0.0).write(&outside.path().join("IMAGE"));
    let directory = folder.join("DICOMDIR");
    let absolute = outside.path().join("IMAGE");
    let mut names = vec!["..\\IMAGE".to_owned(), absolute.display().to_string()];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&absolute, folder.join("LINK")).unwrap();
        names.push("LINK".to_owned());
    }
    for name in names {
        write_directory(&directory, &[&name]);
        let error = read(&directory).unwrap_err();
        assert!(matches!(error, ReadError::BadTag { .. }), "{name}: {error}");
        assert!(error.to_string().contains("outside its folder"), "{error}");
    }
}
