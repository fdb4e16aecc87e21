//! What a recording holds, and what is left of one that was cut short.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use foxglove::messages::{FrameTransforms, LaserScan, Log, PoseInFrame, SceneUpdate};
use nalgebra::{Isometry3, Vector3};
use prost::Message;
use skein_bp::{Event, Origin};
use skein_dbp::Happened;
use skein_ground::recorder::{Level, Recorder, RecorderError};
use skein_wire::NodeName;
use skein_wire::event::{AutopilotSays, Declared as _, Severity};
use skein_wire::proto::TraceEvent;
use skein_wire::{Form, Scan, Solid};

type Outcome = Result<(), Box<dyn std::error::Error>>;

const VEHICLES: [&str; 8] = ["uav/1", "uav/2", "uav/3", "uav/4", "uav/5", "uav/6", "uav/7", "uav/8"];

fn ms(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

fn node() -> NodeName {
    NodeName::new("uav/1").unwrap()
}

fn event(millis: u64, name: &str) -> Happened {
    Happened {
        event: Event::new(name),
        home: node(),
        seq: 3,
        term: 0,
        origin: Origin::Internal,
        requested_by: vec!["navigation".into()],
        choice: Some("priority 10".into()),
        at: ms(millis),
    }
}

/// Records everything there is for a while, as a run does: poses every 20 ms, scans every 100 ms.
fn record(path: &Path, millis: u64) -> Result<Recorder, RecorderError> {
    let mut recorder = Recorder::create(path)?;
    let tree = Solid {
        form: Form::Cylinder { radius: 0.5, height: 8.0 },
        pose: Isometry3::translation(5.0, 0.0, 4.0),
    };
    let wall = Solid { form: Form::Box(Vector3::new(1.0, 2.0, 3.0)), pose: Isometry3::identity() };
    recorder.scene(ms(0), &[tree, wall])?;
    recorder.vehicles(ms(0), &VEHICLES.map(|v| (v, 0.25)))?;
    recorder.log(ms(0), Level::Info, "ground/main", "mission starts")?;
    let scan = Scan {
        stamp: ms(0),
        angle_min: -3.0,
        angle_step: 0.01,
        max_range_m: 40.0,
        ranges_m: (0..720_u16).map(|i| 3.0 + f32::from(i).sin()).collect(),
        up_m: None,
        down_m: None,
        upright_m: Vec::new(),
    };
    for now in (0..millis).step_by(20) {
        let t = now as f64 / 1000.0;
        let pose = |i: usize| Isometry3::translation(t, i as f64, 3.0);
        let poses: Vec<_> = VEHICLES.iter().enumerate().map(|(i, v)| (*v, pose(i))).collect();
        recorder.poses(ms(now), &poses)?;
        for vehicle in VEHICLES {
            if now % 100 == 0 {
                recorder.scan(ms(now), vehicle, &scan)?;
            }
            if now % 1000 == 0 {
                recorder.path(ms(now), vehicle, &[Vector3::zeros(), Vector3::x()])?;
            }
        }
        recorder.trace(&node(), &event(now, "uav/1/advance"))?;
    }
    Ok(recorder)
}

fn by_topic(file: &[u8]) -> Result<BTreeMap<String, Vec<mcap::Message<'_>>>, mcap::McapError> {
    let mut topics: BTreeMap<String, Vec<_>> = BTreeMap::new();
    for message in mcap::MessageStream::new(file)? {
        let message = message?;
        topics.entry(message.channel.topic.clone()).or_default().push(message);
    }
    Ok(topics)
}

#[test]
fn every_topic_is_there_with_its_schema_and_decodes() -> Outcome {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("new/folder/mission.mcap");
    record(&path, 2000)?.finish()?;
    let file = std::fs::read(&path)?;
    let topics = by_topic(&file)?;
    let schema = |topic: &str| topics[topic][0].channel.schema.as_ref().map(|s| s.name.clone());
    assert_eq!(topics.len(), 4 + 3 * VEHICLES.len());
    for (topic, name) in [
        ("/tf", "foxglove.FrameTransforms"),
        ("/scene", "foxglove.SceneUpdate"),
        ("/log", "foxglove.Log"),
        ("/skein/trace", "skein.TraceEvent"),
        ("/uav/3/pose", "foxglove.PoseInFrame"),
        ("/uav/3/path", "foxglove.SceneUpdate"),
        ("/uav/3/scan", "foxglove.LaserScan"),
    ] {
        assert_eq!(schema(topic).as_deref(), Some(name), "{topic}");
    }
    let scene = SceneUpdate::decode(&*topics["/scene"][0].data)?;
    assert_eq!((scene.entities[0].cylinders.len(), scene.entities[0].cubes.len()), (1, 1));
    let transforms = FrameTransforms::decode(&*topics["/tf"][0].data)?.transforms;
    assert_eq!(transforms.iter().map(|t| t.child_frame_id.as_str()).collect::<Vec<_>>(), VEHICLES);
    let pose = PoseInFrame::decode(&*topics["/uav/3/pose"][1].data)?.pose.and_then(|p| p.position);
    assert_eq!(pose.map(|p| (p.x, p.y, p.z)), Some((0.04, 2.0, 3.0)));
    let scan = LaserScan::decode(&*topics["/uav/3/scan"][0].data)?;
    assert_eq!((scan.ranges.len(), scan.end_angle), (720, -3.0 + 0.01 * 719.0));
    assert!((scan.ranges[10] - f64::from(3.0 + 10_f32.sin())).abs() < 0.001);
    let trace = TraceEvent::decode(&*topics["/skein/trace"][1].data)?;
    assert_eq!(trace.node, "uav/1");
    assert_eq!(Happened::try_from(trace)?, event(20, "uav/1/advance"));
    Ok(())
}

#[test]
fn poses_come_at_25_hz_scans_at_5_hz_and_every_event_stays() -> Outcome {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("mission.mcap");
    record(&path, 2000)?.finish()?;
    let file = std::fs::read(&path)?;
    let topics = by_topic(&file)?;
    assert_eq!(topics["/tf"].len(), 50);
    assert_eq!(topics["/uav/8/pose"].len(), 50);
    assert_eq!(topics["/uav/8/scan"].len(), 10);
    assert_eq!(topics["/skein/trace"].len(), 100);
    Ok(())
}

#[test]
fn log_times_are_simulated_and_never_go_back() -> Outcome {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("mission.mcap");
    let mut recorder = record(&path, 500)?;
    recorder.trace(&node(), &event(40, "late"))?;
    recorder.finish()?;
    let file = std::fs::read(&path)?;
    let times: Vec<_> =
        mcap::MessageStream::new(&file)?.map(|m| m.map(|m| m.log_time)).collect::<Result<_, _>>()?;
    assert!(times.is_sorted());
    assert_eq!(times.last(), Some(&480_000_000));
    let late = by_topic(&file)?["/skein/trace"].last().map(|m| m.publish_time);
    assert_eq!(late, Some(40_000_000));
    Ok(())
}

#[test]
fn equal_runs_make_equal_files() -> Outcome {
    let folder = tempfile::tempdir()?;
    let (a, b) = (folder.path().join("a.mcap"), folder.path().join("b.mcap"));
    record(&a, 3000)?.finish()?;
    record(&b, 3000)?.finish()?;
    assert!(std::fs::read(&a)? == std::fs::read(&b)?);
    Ok(())
}

#[test]
fn a_process_that_is_killed_leaves_all_but_the_last_second() -> Outcome {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("mission.mcap");
    let recorder = record(&path, 10_000)?;
    let file = std::fs::read(&path)?;
    // As a killed process would: nothing of what is still in memory reaches the file.
    std::mem::forget(recorder);
    let readable = mcap::MessageStream::new_with_options(&file, mcap::read::Options::IgnoreEndMagic.into())?;
    let newest = readable.map_while(Result::ok).map(|m| m.log_time).max();
    assert!(newest >= Some(9_000_000_000), "{newest:?}");
    Ok(())
}

#[test]
fn a_folder_that_cannot_be_made_is_named() -> Outcome {
    let folder = tempfile::tempdir()?;
    let in_the_way = folder.path().join("file");
    std::fs::write(&in_the_way, "")?;
    let path = in_the_way.join("mission.mcap");
    let error = Recorder::create(&path).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(error.contains(&path.display().to_string()), "{error}");
    Ok(())
}

/// The budget is 3 ms a simulated second in a release build; the factor allows for debug builds and a busy machine.
#[test]
fn eight_vehicles_cost_little() -> Outcome {
    let folder = tempfile::tempdir()?;
    let begin = Instant::now();
    record(&folder.path().join("mission.mcap"), 20_000)?.finish()?;
    let per_second = begin.elapsed() / 20;
    println!("{per_second:?} per simulated second");
    assert!(per_second < ms(60), "{per_second:?}");
    Ok(())
}

#[test]
fn a_line_of_an_autopilot_is_as_serious_in_the_log_as_it_was() -> Outcome {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("mission.mcap");
    let mut recorder = Recorder::create(&path)?;
    for severity in [Severity::Emergency, Severity::Error, Severity::Warning, Severity::Info] {
        let said = AutopilotSays { severity, text: "motor 3".into(), times: 2 }.at("uav/1");
        recorder.event(ms(20), &Happened { event: said, ..event(20, "uav/1/advance") })?;
    }
    recorder.finish()?;
    let file = std::fs::read(&path)?;
    let logged = by_topic(&file)?["/log"]
        .iter()
        .map(|message| Log::decode(&*message.data))
        .collect::<Result<Vec<_>, _>>()?;
    let levels: Vec<_> = logged.iter().map(Log::level).collect();
    assert_eq!(levels, [Level::Fatal, Level::Error, Level::Warning, Level::Info]);
    assert!(logged[0].message.contains("motor 3"), "{}", logged[0].message);
    Ok(())
}
