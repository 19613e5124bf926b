//! Cameras of the stage: the home view as `main_cam`, the name by which `usdrecord` and `usdview` find the camera to use.

use super::layer::{Prim, Property};
use super::names::{CAMERAS, MAIN_CAMERA, PHOTO};
use super::stage::doubles;
use super::value::{Form, Numbers, Value};
use crate::SplatAsset;
use crate::fallback::shown_cameras::{Cameras, ShownCamera};

/// Width of the film, tenths of a unit; only ratios count.
const APERTURE: f64 = 36.0;
/// The far plane, in units of the near plane.
const FAR: f32 = 1e6;

/// The prim with the cameras; `None` without any.
pub(super) fn prim(asset: &SplatAsset, which: Cameras) -> Option<Prim> {
    let cameras = ShownCamera::of(asset, which);
    let mut prim = Prim::def("Scope", CAMERAS);
    prim.children = cameras.iter().enumerate().map(|(i, shown)| camera(i, shown)).collect();
    (!cameras.is_empty()).then_some(prim)
}

fn camera(index: usize, shown: &ShownCamera) -> Prim {
    let name = if index == 0 { MAIN_CAMERA.to_owned() } else { format!("Camera{index}") };
    let mut prim = Prim::def("Camera", &name);
    let focal = APERTURE / shown.size[0];
    let float = |name: &str, value: f64| Property::new("float", name, Value::float(value as f32));
    let near = (shown.near as f32).max(f32::MIN_POSITIVE);
    let photo = Property::uniform("string", PHOTO, Value::string(&shown.name.replace('\0', ""))).custom();
    let operations = ["xformOp:translate", "xformOp:orient"];
    prim.properties = vec![
        Property::new(
            "float2",
            "clippingRange",
            Value::Floats(Numbers::element(Form::Vec2, vec![near, near * FAR])),
        ),
        float("focalLength", focal),
        float("horizontalAperture", APERTURE),
        float("horizontalApertureOffset", focal * shown.offset[0]),
        float("verticalAperture", focal * shown.size[1]),
        float("verticalApertureOffset", focal * shown.offset[1]),
        photo,
        Property::new("double3", operations[0], doubles(Form::Vec3, shown.centre.to_vec())),
        Property::new("quatd", operations[1], doubles(Form::Quaternion, shown.rotation.to_vec())),
        Property::uniform("token[]", "xformOpOrder", Value::Tokens(operations.map(str::to_owned).to_vec())),
    ];
    prim
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fallback::shown_cameras::tests::with_cameras;
    use crate::usd::{UsdOptions, read_usd, write_usd};
    use crate::{ReadLimits, SplatAsset};

    #[test]
    fn stages_have_a_main_camera_and_readers_take_cameras_from_the_metadata() {
        let (asset, folder) = (with_cameras(), tempfile::tempdir().unwrap());
        for (name, cameras) in [("a.usda", Cameras::All), ("b.usdc", Cameras::All), ("c.usdz", Cameras::Home)]
        {
            let path = folder.path().join(name);
            write_usd(&path, &asset, &UsdOptions { cameras, ..UsdOptions::default() }).unwrap();
            let read = read_usd(&path, &ReadLimits::default()).unwrap();
            assert_eq!((read.asset.cameras.len(), read.warnings.len()), (2, 0));
            assert_eq!(crate::usd::validate(&path), []);
        }
        let found = prim(&asset, Cameras::All).unwrap();
        assert_eq!(
            found.children.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(),
            ["main_cam", "Camera1"]
        );
        let float = |name: &str| match found.children[0].value(name) {
            Some(Value::Floats(n)) => n.values[0],
            _ => panic!("{name}"),
        };
        // 40 x 30 pixels of focal lengths 35 and 36, seen from (22, 14): 36 on film are 40 pixels.
        assert!(
            (float("focalLength") - 31.5).abs() < 1e-5 && (float("verticalAperture") - 26.25).abs() < 1e-5
        );
        assert!((float("horizontalApertureOffset") + 1.8).abs() < 1e-5, "two pixels to the left");
        assert!((float("verticalApertureOffset") + 0.875).abs() < 1e-5, "a pixel down");
        assert!(prim(&SplatAsset { cameras: Vec::new(), ..asset }, Cameras::All).is_none());
    }
}
