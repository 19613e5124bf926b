//! The `litetex` command. Everything happens in [`cli`]; the library does the work, and [`viewer`] serves the page of
//! `litetex view`.

mod cli;
mod viewer;

use std::ffi::OsString;

fn main() -> std::process::ExitCode {
    if cfg!(target_os = "linux") && asks_missing_desktop(|name| std::env::var_os(name)) {
        leave_out_device_select();
    }
    cli::main()
}

/// Whether `VK_LAYER_MESA_device_select`, which asks the desktop for its GPU, would look for a desktop without knowing where: then
/// its Wayland library writes a line of its own among our messages. Someone who sets the layer's variables keeps it.
fn asks_missing_desktop(variable: impl Fn(&str) -> Option<OsString>) -> bool {
    let is_absolute =
        |name| variable(name).is_some_and(|path| path.as_encoded_bytes().first() == Some(&b'/'));
    let is_set = |name| variable(name).is_some();
    let is_known =
        is_absolute("XDG_RUNTIME_DIR") || is_absolute("WAYLAND_DISPLAY") || is_set("WAYLAND_SOCKET");
    !is_known && !is_set("NODEVICE_SELECT") && !is_set("MESA_VK_DEVICE_SELECT")
}

/// Leaves that layer out of this process and those that it starts. It only orders GPUs, which we do ourselves.
#[allow(
    unsafe_code,
    reason = "the Vulkan loader reads the environment, and offers nothing else on all versions"
)]
fn leave_out_device_select() {
    // SAFETY: called first in `main`, before there is another thread that could read the environment.
    unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_layer_is_left_out_only_where_it_finds_no_desktop() {
        let of = |set: &[(&str, &str)]| {
            let find = |name: &str| set.iter().find(|(known, _)| *known == name);
            asks_missing_desktop(|name| find(name).map(|(_, value)| value.into()))
        };
        assert!(of(&[]) && of(&[("XDG_RUNTIME_DIR", "run")]) && of(&[("WAYLAND_DISPLAY", "wayland-1")]));
        for kept in [
            ("XDG_RUNTIME_DIR", "/run/user/1000"),
            ("WAYLAND_DISPLAY", "/run/wayland-0"),
            ("WAYLAND_SOCKET", "3"),
            ("NODEVICE_SELECT", "1"),
            ("MESA_VK_DEVICE_SELECT", "10de:2330"),
        ] {
            assert!(!of(&[kept]), "{kept:?}");
        }
    }
}
