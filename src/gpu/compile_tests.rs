//! Every kernel compiles on every installed driver, in the forms that it gets there, and on the first in all; within enforced limits.

use super::adapter::Adapters;
use super::device::{GpuDevice, LimitChoice};
use super::kernels::KERNELS;
use super::shader::{HALF_TILES, SEGMENTS, SUM_LANES};
use crate::Error;

#[test]
fn every_kernel_compiles_within_the_minimum_limits() {
    let adapters = Adapters::enumerate().usable;
    if adapters.is_empty() {
        println!("skipped: no Vulkan driver is installed");
    }
    for (at, choice) in adapters.into_iter().enumerate() {
        let device = GpuDevice::open(&choice, LimitChoice::Downlevel).unwrap();
        let compile = |by_subgroups: bool, flags: &[&str]| {
            for (id, _) in KERNELS.iter().filter(|(_, kernel)| kernel.needs_subgroups() == by_subgroups) {
                if let Err(e) = device.pipelines(&[*id], flags, true) {
                    panic!("{id:?} {flags:?}: {e}");
                }
            }
        };
        if at > 0 {
            compile(false, if choice.hardware { &[] } else { &[HALF_TILES] });
            continue;
        }
        let tiles = [&[][..], &[HALF_TILES]];
        tiles.iter().for_each(|flags| compile(false, flags));
        for (id, kernel) in KERNELS.iter().filter(|(_, kernel)| kernel.name == "raster_fwd") {
            device.pipelines(&[*id], &[SEGMENTS], true).unwrap_or_else(|e| panic!("{:?}: {e}", kernel.flags));
        }
        let lanes = SUM_LANES.iter().filter(|(lanes, _)| *lanes <= device.subgroup_lanes());
        lanes.for_each(|(_, lanes)| tiles.iter().for_each(|flags| compile(true, &[flags, *lanes].concat())));
    }
}

#[test]
fn the_minimum_limits_are_enforced() {
    for choice in Adapters::enumerate().usable {
        let device = GpuDevice::open(&choice, LimitChoice::Downlevel).unwrap();
        let granted = device.device.limits();
        assert_eq!(granted.max_storage_buffers_per_shader_stage, 8);
        assert_eq!(granted.max_compute_workgroup_storage_size, 16 << 10);
        assert_eq!(granted.max_storage_buffer_binding_size, 128 << 20);
        // Our own check reports what would be allocated.
        let texels = 130 << 16;
        let refused = device.buffer("texels", texels, 16).unwrap_err();
        let message = refused.to_string();
        assert!(matches!(refused, Error::DeviceFull(_)), "{message}");
        for part in [format!("texels: {texels} x 16 bytes = 130.0 MiB"), "128.0 MiB".into()] {
            assert!(message.contains(&part), "{message}");
        }
        assert!(device.buffer("texels", 1 << 16, 16).is_ok());
        // wgpu enforces the number of bindings. It does not check workgroup memory: shader_tests does.
        let entry = |binding| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only: true },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        for (bindings, refused) in [(8, false), (9, true)] {
            let scope = device.device.push_error_scope(wgpu::ErrorFilter::Validation);
            let entries: Vec<_> = (0..bindings).map(entry).collect();
            let layout = device.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: None,
                entries: &entries,
            });
            let _ = device.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: None,
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
            assert_eq!(pollster::block_on(scope.pop()).is_some(), refused, "{bindings} bindings");
        }
    }
}
