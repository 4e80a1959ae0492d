//! A phantom opened in a studio, and requests as sent by the page.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use axum::Router;
use axum::body::{Body, Bytes};
use axum::http::{Request, Response, StatusCode};
use ppa_ct::{ReadOptions, Volume, write_nifti};
use ppa_dataset::labels::{BoneFile, BoneNumbers};
use ppa_generate::prepare;
use ppa_mesh::LimbSettings;
use ppa_phantom::{LowerLeg, TableTop};
use ppa_scene::{LandmarkOverrides, Side};
use ppa_studio::{Opening, Studio};
use tempfile::TempDir;
use tower::ServiceExt;

/// Default host of requests.
pub const HOST: &str = "127.0.0.1:8123";

/// An opened phantom with the cookie of a browser.
pub struct Browser {
    pub folder: TempDir,
    pub case: PathBuf,
    pub router: Router,
    cookie: String,
    runtime: tokio::runtime::Runtime,
}

/// A complete answer.
pub struct Answer {
    pub status: StatusCode,
    pub headers: axum::http::HeaderMap,
    pub body: Bytes,
}

impl Answer {
    pub fn json(&self) -> serde_json::Value {
        assert_eq!(self.status, StatusCode::OK, "{}", self.text());
        serde_json::from_slice(&self.body).unwrap()
    }

    pub fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }
}

/// Writes P01 and its case into a folder, with voxels for most tests.
pub fn phantom(folder: &Path) -> PathBuf {
    static MADE: LazyLock<TempDir> = LazyLock::new(|| made(2.0)); // the coarsest in which the ankle is recognised
    copy(MADE.path(), folder);
    folder.join("p01.case.toml")
}

/// Writes P01 and its case into a folder, with voxels fine enough for the gutters of the ankle.
pub fn fine_phantom(folder: &Path) -> PathBuf {
    static MADE: LazyLock<TempDir> = LazyLock::new(|| made(1.25));
    copy(MADE.path(), folder);
    folder.join("p01.case.toml")
}

/// Copies the contents of a folder into another one.
pub fn copy(from: &Path, to: &Path) {
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            std::fs::create_dir(&target).unwrap();
            copy(&path, &target);
        } else {
            std::fs::copy(&path, &target).unwrap();
        }
    }
}

/// Makes a folder with P01, its bones and its case, which names them by relative paths.
fn made(spacing_mm: f64) -> TempDir {
    let made = tempfile::tempdir().unwrap();
    let folder = made.path();
    let (scan, file) = (folder.join("p01.nii"), folder.join("p01.case.toml"));
    let leg = LowerLeg::p01();
    let volume = leg.voxelise(spacing_mm, TableTop::Absent).unwrap();
    write_nifti(&scan, &volume).unwrap();
    let bones = folder.join("p01.bones.nii");
    let numbers = leg.bone_labels(volume.grid()).into_iter().map(f32::from);
    let labels = Volume::new(volume.grid().clone(), numbers.collect()).unwrap();
    write_nifti(&bones, &labels).unwrap();
    let (surface, choices) = (LimbSettings::default(), LandmarkOverrides::default());
    let reading = ReadOptions::default();
    let (mut case, _) = prepare(&scan, &reading, Side::Right, &surface, &choices).unwrap();
    case.bones = Some(BoneFile {
        path: bones,
        numbers: BoneNumbers::default(),
        segmented: false,
    });
    case.write(&file).unwrap();
    made
}

impl Browser {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let case = phantom(folder.path());
        Self::of(folder, case)
    }

    pub fn of(folder: TempDir, case: PathBuf) -> Self {
        Self::opened(folder, &Opening::of(&case))
    }

    /// Opens a case with further options.
    pub fn opened(folder: TempDir, opening: &Opening) -> Self {
        let case = opening.path.clone().unwrap_or_default();
        let studio = Studio::open(opening).unwrap();
        let router = studio.router();
        // One thread, so that requests begin in the order of sending.
        let mut runtime = tokio::runtime::Builder::new_current_thread();
        let runtime = runtime.enable_all().build().unwrap();
        let address = studio.address(HOST.parse().unwrap());
        let query = address.split_once('?').unwrap().1;
        let enter = request("GET", &format!("/?{query}"), "").header("host", HOST);
        let enter = enter.body(Body::empty()).unwrap();
        let entered = runtime.block_on(router.clone().oneshot(enter)).unwrap();
        assert_eq!(entered.status(), StatusCode::SEE_OTHER);
        let cookie = entered.headers()["set-cookie"].to_str().unwrap();
        assert!(cookie.contains("HttpOnly; SameSite=Strict"));
        let cookie = cookie.split(';').next().unwrap().to_owned();
        Self {
            folder,
            case,
            router,
            cookie,
            runtime,
        }
    }

    pub fn get(&self, path: &str) -> Answer {
        let request = request("GET", path, &self.cookie).header("host", HOST);
        self.send(request.body(Body::empty()).unwrap())
    }

    pub fn post(&self, path: &str, json: &serde_json::Value) -> Answer {
        self.send(self.posting(path, json.to_string()))
    }

    pub fn posting(&self, path: &str, body: String) -> Request<Body> {
        let request = request("POST", path, &self.cookie);
        let request = request.header("host", HOST);
        let request = request.header("origin", format!("http://{HOST}"));
        let request = request.header("content-type", "application/json");
        request.body(Body::from(body)).unwrap()
    }

    pub fn send(&self, request: Request<Body>) -> Answer {
        self.runtime
            .block_on(async { read(self.router.clone().oneshot(request).await.unwrap()).await })
    }

    /// Sends all requests at once, in this order.
    pub fn send_all(&self, requests: Vec<Request<Body>>) -> Vec<Answer> {
        self.runtime.block_on(async {
            let mut answers = Vec::new();
            let mut waiting = tokio::task::JoinSet::new();
            for (number, request) in requests.into_iter().enumerate() {
                let router = self.router.clone();
                waiting.spawn(async move {
                    (number, read(router.oneshot(request).await.unwrap()).await)
                });
                // Each request begins before the next one is sent.
                tokio::task::yield_now().await;
            }
            while let Some(done) = waiting.join_next().await {
                answers.push(done.unwrap());
            }
            answers.sort_by_key(|(number, _)| *number);
            answers.into_iter().map(|(_, answer)| answer).collect()
        })
    }
}

pub fn request(method: &str, path: &str, cookie: &str) -> axum::http::request::Builder {
    let request = Request::builder().method(method).uri(path);
    if cookie.is_empty() {
        request
    } else {
        request.header("cookie", cookie)
    }
}

async fn read(response: Response<Body>) -> Answer {
    let (parts, body) = response.into_parts();
    Answer {
        status: parts.status,
        headers: parts.headers,
        body: axum::body::to_bytes(body, usize::MAX).await.unwrap(),
    }
}
