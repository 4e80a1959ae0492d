//! `ppa studio` as a process: its address, its exit, and the files it refuses to open.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use ppa_ct::write_nifti;
use ppa_phantom::{LowerLeg, TableTop};
use serde_json::Value;

use crate::{contains, contents, fail, phantom, ppa, succeed, write_plan};

/// A running studio, and the cookie of a browser that has opened its address.
pub struct Served {
    child: Child,
    host: String,
    cookie: String,
}

impl Served {
    pub fn start(folder: &Path, arguments: &str) -> Self {
        Self::of(ppa(folder, &format!("studio --no-open {arguments}")))
    }

    fn of(mut command: Command) -> Self {
        let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut address = String::new();
        let mut lines = BufReader::new(child.stdout.as_mut().unwrap());
        lines.read_line(&mut address).unwrap();
        let address = address.trim().strip_prefix("http://").unwrap_or_else(|| {
            let mut said = String::new();
            let stderr = child.stderr.as_mut().unwrap();
            stderr.read_to_string(&mut said).unwrap();
            panic!("no address: {said}")
        });
        let (host, path) = address.split_once('/').unwrap();
        let mut served = Self {
            child,
            host: host.to_owned(),
            cookie: String::new(),
        };
        let entered = String::from_utf8(served.get(&format!("/{path}"))).unwrap();
        let cookie = entered.split("set-cookie: ").nth(1).unwrap();
        cookie
            .split(';')
            .next()
            .unwrap()
            .clone_into(&mut served.cookie);
        served
    }

    /// The complete answer to a request, including headers.
    pub fn get(&self, path: &str) -> Vec<u8> {
        self.send(&format!("GET {path} HTTP/1.1\r\n"), "")
    }

    pub fn post(&self, path: &str, json: &str) -> Vec<u8> {
        let head = format!(
            "POST {path} HTTP/1.1\r\norigin: http://{}\r\ncontent-type: application/json\r\ncontent-length: {}\r\n",
            self.host,
            json.len()
        );
        self.send(&head, json)
    }

    fn send(&self, head: &str, body: &str) -> Vec<u8> {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        let (host, cookie) = (&self.host, &self.cookie);
        let head =
            format!("{head}host: {host}\r\ncookie: {cookie}\r\nconnection: close\r\n\r\n{body}");
        stream.write_all(head.as_bytes()).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        answer
    }

    /// Sends Ctrl-C, waits and returns the exit status.
    pub fn stop(mut self) -> Option<i32> {
        let mut kill = Command::new("kill");
        kill.args(["-INT", &self.child.id().to_string()]);
        assert!(kill.status().unwrap().success());
        self.child.wait().unwrap().code()
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn a_studio_serves_until_ctrl_c() {
    let folder = tempfile::tempdir().unwrap();
    let case = phantom().join("p01.toml");
    let served = Served::start(folder.path(), &case.display().to_string());
    let page = String::from_utf8(served.get("/")).unwrap();
    contains(&page, &["HTTP/1.1 200", "<title>ppa studio</title>"]);
    let state = String::from_utf8(served.get("/api/state")).unwrap();
    contains(&state, &["\"name\":\"p01.toml\"", "\"limb\":\"lower_leg\""]);
    assert_eq!(served.stop(), Some(0));
}

#[test]
fn a_killed_studio_starts_again_at_the_same_address() {
    let folder = tempfile::tempdir().unwrap();
    let case = phantom().join("p01.toml");
    let start = || {
        let mut command = ppa(folder.path(), "studio --no-open");
        command.arg(&case).env("XDG_STATE_HOME", folder.path());
        Served::of(command)
    };
    let mut first = start();
    first.child.kill().unwrap();
    first.child.wait().unwrap();
    let second = start();
    assert_eq!(first.host, second.host);
    // A browser with the first one's cookie is let in.
    let state = String::from_utf8(first.get("/api/state")).unwrap();
    contains(&state, &["HTTP/1.1 200", "\"name\":\"p01.toml\""]);
    // A second studio at the same time has its own address.
    let beside = start();
    assert_ne!(beside.host, second.host);
    assert_ne!(beside.cookie, second.cookie);
}

#[test]
fn slow_clients_delay_neither_the_page_nor_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let case = phantom().join("p01.toml");
    let served = Served::start(folder.path(), &case.display().to_string());
    let connected = |text: String| {
        let mut stream = TcpStream::connect(&served.host).unwrap();
        stream.write_all(text.as_bytes()).unwrap();
        stream
    };
    let (host, cookie) = (&served.host, &served.cookie);
    let open: Vec<TcpStream> = (0..40)
        .flat_map(|_| {
            let head = format!("host: {host}\r\ncookie: {cookie}\r\n");
            [
                // Half a request, a request without its body, and an answer that nobody reads.
                "GET /api/sta".to_owned(),
                format!("POST /api/depth HTTP/1.1\r\n{head}origin: http://{host}\r\ncontent-type: application/json\r\ncontent-length: 99\r\n\r\n{{"),
                format!("GET /api/skin HTTP/1.1\r\n{head}\r\n"),
            ]
        })
        .map(connected)
        .collect();
    let begun = Instant::now();
    let state = String::from_utf8(served.get("/api/state")).unwrap();
    contains(&state, &["HTTP/1.1 200"]);
    assert!(begun.elapsed() < Duration::from_secs(10));
    let (ended, end) = std::sync::mpsc::channel();
    std::thread::spawn(move || ended.send(served.stop()));
    assert_eq!(end.recv_timeout(Duration::from_secs(30)), Ok(Some(0)));
    drop(open);
}

#[test]
fn the_mortise_of_the_built_in_phantom_faces_the_beam_at_18() {
    let folder = tempfile::tempdir().unwrap();
    let served = Served::start(folder.path(), "");
    let json = |answer: Vec<u8>| {
        let text = String::from_utf8(answer).unwrap();
        let body = text.split_once("\r\n\r\n").unwrap().1;
        serde_json::from_str::<Value>(&body[body.find('{').unwrap()..]).unwrap()
    };
    let state = json(served.get("/api/state"));
    let mortise: [f64; 3] = serde_json::from_value(state["mortise"].clone()).unwrap();
    let up = |angle: f64| {
        let room = served.post("/api/room", &format!(r#"{{"angle_deg": {angle}}}"#));
        let rows: [[f64; 4]; 4] =
            serde_json::from_value(json(room)["room_from_ct"].clone()).unwrap();
        (0..3).map(|i| rows[2][i] * mortise[i]).sum::<f64>()
    };
    // P01's mortise view is at 18 degrees; the detected axis and the foot's support on the table tilt it a little.
    assert!(up(18.0) > 6.0_f64.to_radians().cos(), "{}", up(18.0));
    assert!(up(0.0) < 12.0_f64.to_radians().cos(), "{}", up(0.0));
}

#[test]
fn the_case_of_an_opened_scan_is_saved_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let scan = phantom().join("p01.nii");
    let served = Served::start(folder.path(), &format!("{} --side r", scan.display()));
    let file = folder.path().join("p01.case.toml");
    assert!(!file.exists());
    let saved = String::from_utf8(served.post("/api/save", "{}")).unwrap();
    contains(&saved, &["HTTP/1.1 200", "\"is_saved\":true"]);
    let prepared = std::fs::read_to_string(phantom().join("p01.toml")).unwrap();
    let choices = |text: &str| text.split("[choices]").nth(1).unwrap().to_owned();
    let case = std::fs::read_to_string(&file).unwrap();
    assert_eq!(choices(&case), choices(&prepared));
}

#[test]
fn a_dose_of_the_page_is_that_of_its_command() {
    let folder = tempfile::tempdir().unwrap();
    let case = phantom().join("p01.toml");
    let served = Served::start(folder.path(), &case.display().to_string());
    let what_if = r#"{"angle_deg": 18, "kvp": 55, "mas": 4}"#;
    let json = |answer: Vec<u8>| {
        let text = String::from_utf8(answer).unwrap();
        contains(&text, &["HTTP/1.1 200"]);
        let body = text.split_once("\r\n\r\n").unwrap().1;
        serde_json::from_str::<serde_json::Value>(&body[body.find('{').unwrap()..]).unwrap()
    };
    let of_page = json(served.post("/api/dose", what_if));
    let commands = json(served.post("/api/commands", what_if));
    let command = commands["dose"].as_str().unwrap();
    let command = command.strip_prefix("ppa ").unwrap();
    let of_command: serde_json::Value =
        serde_json::from_str(&succeed(folder.path(), command)).unwrap();
    assert_eq!(
        of_command["histories"].as_f64(),
        of_page["histories"].as_f64()
    );
    let names = of_command["materials"].as_array().unwrap();
    let column = |key: &str| {
        of_command[key]
            .as_array()
            .unwrap()
            .iter()
            .map(|value| value.as_f64().unwrap())
    };
    let rows: Vec<_> = column("material_mass_g")
        .zip(column("material_dose_gy_per_history"))
        .collect();
    let matter = of_page["matter"].as_array().unwrap();
    // Soft tissue, fat and muscle in several mixtures, muscle, bone; after the row of all voxels.
    assert_eq!(matter.len(), 5, "{matter:?}");
    for of in &matter[1..] {
        let name = of["name"].as_str().unwrap();
        let is_of = |material: &Value| material.as_str().unwrap().split(',').next() == Some(name);
        let of_matter = names
            .iter()
            .zip(&rows)
            .filter(|(material, _)| is_of(material));
        let (mass, energy) = of_matter.fold((0.0, 0.0), |(mass, energy), (_, (g, gray))| {
            (mass + g, energy + g * gray)
        });
        let [mass_g, gray] = ["mass_g", "gy_per_history"].map(|key| of[key].as_f64().unwrap());
        assert!(
            (mass_g / mass - 1.0).abs() < 1e-9,
            "{name}: {mass_g}, {mass}"
        );
        assert!(
            (gray * mass_g / energy - 1.0).abs() < 1e-9,
            "{name}: {gray}, {energy}"
        );
    }
}

#[test]
fn a_scan_without_a_joint_opens_for_landmarks_by_hand() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let leg = LowerLeg::p01().voxelise(2.5, TableTop::Absent).unwrap();
    let [i, j, k] = leg.grid().size();
    let calf = leg.crop([0, 0, 2 * k / 3], [i, j, k]).unwrap();
    write_nifti(&folder.join("calf.nii"), &calf).unwrap();
    let served = Served::start(folder, "calf.nii --side r");
    let answer = |bytes: Vec<u8>| {
        let text = String::from_utf8(bytes).unwrap();
        let body = text.split_once("\r\n\r\n").unwrap().1;
        serde_json::from_str::<serde_json::Value>(&body[body.find('{').unwrap()..]).unwrap()
    };
    let state = answer(served.get("/api/state"));
    assert_eq!(state["choices"]["limb"], "other");
    assert_eq!(state["automatic"], state["landmarks"]);
    let note = state["note"].as_str().unwrap();
    assert!(note.contains("neither an ankle"), "{note}");
    let mut joint: [f64; 3] =
        serde_json::from_value(state["landmarks"]["joint_centre"].clone()).unwrap();
    joint[2] += 20.0;
    let by_hand = serde_json::json!({ "limb": "other", "joint_centre": joint });
    let state = answer(served.post("/api/choices", &by_hand.to_string()));
    assert_eq!(state["landmarks"]["joint_centre"], serde_json::json!(joint));
    assert_ne!(state["automatic"], state["landmarks"]);
    let refused = String::from_utf8(served.post("/api/choices", "{}")).unwrap();
    contains(&refused, &["422", "neither an ankle"]);
}

#[test]
fn a_dataset_of_the_page_is_that_of_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_plan(folder, "");
    let served = Served::start(folder, "plan.toml");
    let begun = served.post("/api/generation", r#"{"folder": "by_page"}"#);
    contains(&String::from_utf8(begun).unwrap(), &["HTTP/1.1 200"]);
    let started = Instant::now();
    let command = loop {
        let state = served.get("/api/generation?folder=by_page");
        let state = String::from_utf8(state).unwrap();
        if state.contains(r#""phase":"complete""#) {
            break state
                .split(r#""generate":"ppa "#)
                .nth(1)
                .unwrap()
                .to_owned();
        }
        assert!(started.elapsed() < Duration::from_secs(300), "{state}");
        std::thread::sleep(Duration::from_millis(100));
    };
    // The command shown on the page, into another folder.
    let command = command.split('"').next().unwrap();
    succeed(folder, &command.replace("by_page", "by_command"));
    let expected = contents(&folder.join("by_command"));
    assert!(expected.len() > 15, "{}", expected.len());
    assert!(contents(&folder.join("by_page")) == expected);
    assert_eq!(served.stop(), Some(0));
}

#[test]
fn grading_in_a_studio_uses_the_key_of_an_export() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_plan(here, "");
    succeed(here, "generate plan.toml --out data");
    succeed(here, "label export data --out out --seed 5");
    let served = Served::start(here, "data");
    let post = |path: &str, readers: &str, more: &str| {
        let body =
            format!(r#"{{"folder": "data", "readers": "{readers}", "reader": "ben", {more}}}"#);
        let answer = String::from_utf8(served.post(path, &body)).unwrap();
        contains(&answer, &["HTTP/1.1 200"]);
        answer
    };
    let read = |name: &str| std::fs::read_to_string(here.join(name)).unwrap();
    post("/api/grading", "new", r#""seed": 5, "every_deg": 0.5"#);
    assert_eq!(read("new.key.csv"), read("out.key.csv"));
    let found = post("/api/grading", "out", r#""seed": 6, "every_deg": 45"#);
    contains(&found, &[r#""key_found":true"#]);
    let key = read("out.key.csv");
    for row in key.lines().skip(1) {
        let name = row.split(',').next().unwrap();
        post(
            "/api/grading/grade",
            "out",
            &format!(r#""image": "{name}", "grade": 1.5"#),
        );
    }
    let command = found.split(r#""import":"ppa "#).nth(1).unwrap();
    let command = command.split('"').next().unwrap();
    assert!(command.ends_with("/grades_*.csv"), "{command}");
    // With the pattern expanded as by a shell.
    succeed(here, &command.replace("grades_*.csv", "grades_ben.csv"));
    assert!(read("data/grades.csv").contains(",ben,1.5,"));
}

#[test]
fn a_studio_refuses_what_it_cannot_show_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scan = phantom().join("p01.nii");
    let refused = fail(folder, &format!("studio {}", scan.display()));
    contains(&refused, &["p01.nii is a scan", "--side"]);
    contains(
        &fail(folder, "studio absent.case.toml"),
        &["absent.case.toml"],
    );
    let refused = fail(folder, "studio --bind 0.0.0.0");
    contains(&refused, &["0.0.0.0", "unencrypted", "--i-know"]);
    let plan = "version = 1\n[[case]]\nfile = \"gone.case.toml\"\npatient = 0\n";
    std::fs::write(folder.join("plan.toml"), plan).unwrap();
    contains(&fail(folder, "studio plan.toml"), &["gone.case.toml"]);
    let watch = "studio --watch frames --run left --roi-left 1,2,30 --roi-right 1,2,30";
    contains(&fail(folder, watch), &["left/config.toml"]);
}
