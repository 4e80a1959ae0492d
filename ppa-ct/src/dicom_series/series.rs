//! The series in a folder, and the choice of one.

use std::collections::BTreeMap;
use std::path::Path;

use super::header::{Found, Series, Slice};
use crate::error::ReadError;
use crate::scan::{ReadOptions, SeriesChoice, SeriesSummary, Warning, WarningCode};

/// The files of a folder, sorted by kind and series.
pub(super) struct Sorted {
    /// Ordered by series number, then by first file.
    series: Vec<Member>,
    localizers: usize,
    others: usize,
    /// Number of missing files listed in a DICOMDIR.
    missing: usize,
    /// Number of files that are named or listed as slices, but are not DICOM.
    damaged: usize,
}

struct Member {
    uid: String,
    summary: SeriesSummary,
    /// Empty for modalities that are not supported.
    slices: Vec<Slice>,
    /// Why the first unreadable image, and its series with it, is refused.
    refused: Option<ReadError>,
}

impl Member {
    fn without_images(series: Series) -> Self {
        Self {
            summary: SeriesSummary {
                number: series.number,
                modality: series.modality,
                slices: 0,
                size: series.size,
                read: false,
                refused: None,
            },
            uid: series.uid,
            slices: Vec::new(),
            refused: None,
        }
    }
}

/// The series to read.
pub(super) struct Chosen {
    pub slices: Vec<Slice>,
    pub modality: Option<String>,
    /// Warning if the modality is not CT.
    pub modality_warning: Option<Warning>,
    /// This series and those that were not read.
    pub all: Vec<SeriesSummary>,
}

impl Sorted {
    /// Groups files by series.
    pub fn of(found: Vec<Found>) -> Self {
        let mut by_uid = BTreeMap::<String, (usize, Member)>::new();
        let (mut localizers, mut others, mut missing, mut damaged) = (0, 0, 0, 0);
        for (order, item) in found.into_iter().enumerate() {
            let (series, slices, refused) = match item {
                Found::Localizer => {
                    localizers += 1;
                    continue;
                }
                Found::Directory(listed) => {
                    others += 1;
                    missing += listed.missing;
                    continue;
                }
                Found::NotAnImage => {
                    others += 1;
                    continue;
                }
                Found::Damaged => {
                    damaged += 1;
                    continue;
                }
                Found::OtherModality(series) => (series, Vec::new(), None),
                Found::Refused(series, error) => (series, Vec::new(), Some(error)),
                Found::Slices(series, slices) => (series, slices, None),
            };
            let (_, member) = by_uid
                .entry(series.uid.clone())
                .or_insert_with(|| (order, Member::without_images(series)));
            member.summary.slices += slices.len().max(1);
            member.slices.extend(slices);
            if let (None, Some(error)) = (&member.refused, refused) {
                member.summary.refused = Some(error.without_path());
                member.refused = Some(error);
            }
        }
        let mut series = by_uid.into_values().collect::<Vec<_>>();
        series.sort_by_key(|(order, member)| (member.summary.number, *order));
        Self {
            series: series.into_iter().map(|(_, member)| member).collect(),
            localizers,
            others,
            missing,
            damaged,
        }
    }

    /// Warnings about files that belong to no series.
    pub fn warnings(&self) -> Vec<Warning> {
        let mut warnings = Vec::new();
        if self.localizers > 0 {
            warnings.push(Warning {
                code: WarningCode::LocalizersDropped,
                text: format!(
                    "left out: {} (scout views)",
                    ppa_core::text::count(self.localizers, "localizer image")
                ),
            });
        }
        if self.others > 0 {
            warnings.push(Warning {
                code: WarningCode::NonImagesDropped,
                text: format!(
                    "left out: {} without an image",
                    ppa_core::text::count(self.others, "DICOM object")
                ),
            });
        }
        if self.missing > 0 {
            warnings.push(Warning {
                code: WarningCode::FilesMissing,
                text: format!("the DICOMDIR lists {} files that are missing", self.missing),
            });
        }
        if self.damaged > 0 {
            warnings.push(Warning {
                code: WarningCode::FilesMissing,
                text: format!(
                    "{} named or listed as DICOM, but empty or damaged: slices may be missing",
                    ppa_core::text::count(self.damaged, "file")
                ),
            });
        }
        warnings
    }

    /// Returns the series asked for, or the only one present.
    pub fn choose(
        mut self,
        source: &Path,
        looked_at: usize,
        options: &ReadOptions,
    ) -> Result<Chosen, ReadError> {
        let path = source.to_owned();
        if self.series.is_empty() {
            return Err(match self.localizers {
                0 => ReadError::NoDicom {
                    path,
                    files: looked_at,
                    volume: None,
                },
                localizers => ReadError::OnlyLocalizers { path, localizers },
            });
        }
        let fits = |member: &Member| match &options.series {
            None => true,
            Some(SeriesChoice::Number(number)) => member.summary.number == Some(*number),
            Some(SeriesChoice::Uid(uid)) => member.uid == *uid,
        };
        let fitting = (0..self.series.len()).filter(|&n| fits(&self.series[n]));
        let summaries = |of: &[usize]| {
            let of = of.iter().map(|&n| self.series[n].summary.clone());
            of.collect::<Vec<_>>()
        };
        let chosen = match &fitting.collect::<Vec<_>>()[..] {
            [chosen] => *chosen,
            [] => {
                let series = self.series.into_iter().map(|m| m.summary).collect();
                return Err(ReadError::NoSuchSeries { path, series });
            }
            several => {
                let series = summaries(several);
                return Err(ReadError::SeveralSeries { path, series });
            }
        };
        let member = &mut self.series[chosen];
        member.summary.read = true;
        let slices = std::mem::take(&mut member.slices);
        let refused = member.refused.take();
        let modality = member.summary.modality.clone();
        let other = modality.clone().filter(|m| m != "CT");
        if let Some(modality) = &other
            && !options.force
        {
            let modality = modality.clone();
            return Err(ReadError::NotCt { modality, path });
        }
        if let Some(error) = refused {
            return Err(error);
        }
        Ok(Chosen {
            slices,
            modality_warning: other.map(|modality| Warning {
                code: WarningCode::NotCt,
                text: format!("modality {modality} is read as if it were CT"),
            }),
            modality,
            all: self.series.into_iter().map(|m| m.summary).collect(),
        })
    }
}
