// Measurements of the benchmark: every workload is one that the library renders, a row has all its figures, the
// work it counts is there, and a row that fails is told as such.
#include "measure.hpp"

#include <doctest/doctest.h>

#include "costs.hpp"
#include "device/context.hpp"
#include "dpr/error.hpp"
#include "results_file.hpp"
#include "stages.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace measure_test {

using namespace dpr;
using bench::Json;

namespace {

/// A workload in miniature.
bench::Workload small(const std::string& name) {
  bench::Workload workload = bench::make_workloads(name).front();
  workload.scene.width = workload.scene.height = 16;
  return workload;
}

}  // namespace

TEST_SUITE("bench-smoke") {
  TEST_CASE("every workload has a description and rows that the library accepts") {
    for (const auto& names : {bench::workload_names(), bench::sweep_names()}) {
      for (const std::string_view name : names) {
        CAPTURE(name);
        CHECK_FALSE(bench::describe(name).empty());
        if (name == "million") continue;  // a mesh of a second
        for (const bench::Workload& workload : bench::make_workloads(name)) {
          CHECK(workload.name == name);
          CHECK_FALSE(workload.variants.empty());
          for (const bench::Variant& variant : workload.variants) CHECK_NOTHROW(validate(variant.smoothing));
        }
      }
    }
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, bench::make_workloads("sphere"), "sphere256");
  }

  TEST_CASE("a row has every figure, of every estimator") {
    if (test::is_reduced()) return;
    const Device device = open_device();
    const bench::Peaks peaks{100, 10};
    const bench::Workload workload = small("sphere64");
    for (const bench::Variant& variant : workload.variants) {
      const Json row = bench::measure(device, peaks, workload, variant, {.repetitions = 2, .max_seconds = 5});
      CAPTURE(row.dump());
      CHECK(row["status"] == "ok");
      CHECK(row["forward_ms"]["n"] == 2);
      CHECK(row["backward_ms"]["median"].get<double>() > 0);
      CHECK(row["fragments"].get<std::size_t>() > 0);
      CHECK(row["peak_device_bytes"].get<std::size_t>() > 0);
      // The vertices and their colours go there, gradients come back, and no image.
      const Json& transfers = row["transfers"];
      const std::size_t vertices = 16 * workload.scene.meshes[0].mesh.positions.size();
      CHECK(transfers["bytes_to_device"].get<std::size_t>() >= 2 * vertices);
      CHECK(transfers["bytes_to_device"].get<std::size_t>() < 3 * vertices);
      CHECK(transfers["bytes_from_device"].get<std::size_t>() >= vertices);
      CHECK(transfers["host_waits"].get<std::size_t>() > 0);
      CHECK(row["peak_rss_bytes"].get<std::size_t>() > 0);
      for (const char* const name : {"rasterize", "aggregate"}) {
        const Json& stage = row["stages"][name];
        CHECK(stage["forward_ms"].get<double>() > 0);
        CHECK(stage["backward_ms"].get<double>() > 0);
        CHECK(stage["gflops"].get<double>() > 0);
        CHECK(stage["gbytes_per_s"].get<double>() > 0);
        CHECK(stage["fraction_of_peak"].get<double>() ==
              doctest::Approx(stage["gflops"].get<double>() / peaks.gflops));
      }
    }
    CHECK(impl_of(device).profile == nullptr);
  }

  TEST_CASE("where the camera moves, no vertices go to the device") {
    const Device device = open_device();
    const bench::Workload workload = small("sphere256");
    const auto moved = std::ranges::find(workload.variants, bench::Moves::camera, &bench::Variant::moves);
    REQUIRE(moved != workload.variants.end());
    const Json row =
        bench::measure(device, {100, 10}, workload, *moved, {.repetitions = 2, .max_seconds = 5});
    CAPTURE(row.dump());
    CHECK(row["moves"] == "camera");
    const auto sent = row["transfers"]["bytes_to_device"].get<std::size_t>();
    CHECK(sent > 0);
    CHECK(sent < 12 * workload.scene.meshes[0].mesh.positions.size());
  }

  TEST_CASE("a row that the library refuses is a row with a reason") {
    const Device device = open_device();
    bench::Workload workload = small("cube128");
    workload.variants.front().smoothing.sigma = -1;
    const Json row = bench::measure(device, {1, 1}, workload, workload.variants.front(), {});
    CHECK(row["status"] == "failed");
    CHECK(test::contains(row["reason"].get<std::string>(), "sigma"));
    CHECK_FALSE(row.contains("forward_ms"));
    CHECK_FALSE(bench::is_measured(row));
  }

  TEST_CASE("a slow row stops repeating when its time is spent") {
    if (test::is_reduced()) return;
    const bench::Workload workload = small("cube128");
    const Json row = bench::measure(open_device(), {1, 1}, workload, workload.variants.front(),
                                    {.repetitions = 1000, .max_seconds = 0});
    CHECK(row["forward_ms"]["n"] == 1);
  }

  TEST_CASE("quartiles are those of the sorted values") {
    const Json q = bench::quartiles({5, 1, 4, 2, 3});
    CHECK(q["median"] == 3);
    CHECK(q["q1"] == 2);
    CHECK(q["q3"] == 4);
    CHECK(q["min"] == 1);
    CHECK(q["p95"] == 5);
    CHECK(q["n"] == 5);
  }

  TEST_CASE("work is counted: one triangle over every pixel, near and far") {
    Scene scene;
    scene.smoothing = smoothing_preset("gaussian");
    scene.width = scene.height = 16;
    Mesh mesh;
    mesh.positions = {{-99, -99, -2}, {99, -99, -2}, {0, 99, -2}};
    mesh.faces = {{0, 1, 2}};
    scene.meshes.push_back({mesh});
    const Device device = open_device();
    const auto count = [&](const Smoothing& smoothing) {
      scene.smoothing = smoothing;
      Renderer renderer(device);
      renderer.set_scene(scene);
      renderer.forward();
      return bench::count_work(renderer);
    };
    Smoothing smoothing = smoothing_preset("gaussian");
    const bench::FrameWork one_slot = count(smoothing);
    CHECK(one_slot.pairs == 4);
    CHECK(one_slot.fragments == 256);
    CHECK(one_slot.pixels == 256);
    CHECK(one_slot.forward_evaluations ==
          0);  // the background is out of reach: a slot alone needs no integral
    smoothing.gamma = 1;
    CHECK(count(smoothing).backward_evaluations == 256 * 16 * 2);
    smoothing.aggregation_estimator = Estimator::monte_carlo;
    smoothing.samples = 5;
    CHECK(count(smoothing).forward_evaluations == 256 * 5 * 2);
    smoothing.aggregation_estimator = Estimator::exact;
    smoothing.depth_prior = Prior::gumbel;
    CHECK(count(smoothing).forward_evaluations == 256 * 2);
    smoothing.composition = Composition::joint;
    smoothing.depth_prior = Prior::gaussian;
    CHECK(count(smoothing).forward_evaluations == 0);  // a fragment alone needs no integral
    scene.meshes.push_back(scene.meshes.front());
    CHECK(count(smoothing).forward_evaluations == 256 * 16 * 2);
  }

  TEST_CASE("the cost table is linear in the work, and says nothing of what it does not count") {
    const bench::FrameWork work{.pairs = 10,
                                .fragments = 100,
                                .pixels = 64,
                                .forward_evaluations = 1000,
                                .backward_evaluations = 900};
    bench::FrameWork twice = work;
    for (double* value : {&twice.pairs, &twice.fragments, &twice.pixels, &twice.forward_evaluations,
                          &twice.backward_evaluations}) {
      *value *= 2;
    }
    const Smoothing triangles = smoothing_preset("gaussian");
    for (const char* const stage : {"rasterize", "shade", "occupancy", "aggregate"}) {
      const auto once = bench::stage_cost(stage, work, triangles),
                 doubled = bench::stage_cost(stage, twice, triangles);
      REQUIRE(once);
      CHECK(doubled->forward.flops == doctest::Approx(2 * once->forward.flops));
      CHECK(doubled->backward.bytes == doctest::Approx(2 * once->backward.bytes));
    }
    CHECK_FALSE(bench::stage_cost("scan", work, {}));
    CHECK_FALSE(bench::stage_cost("aggregate", bench::FrameWork{}, {}));
    Smoothing cauchy = smoothing_preset("gaussian");
    cauchy.occupancy_prior = Prior::cauchy;
    CHECK_FALSE(bench::stage_cost("occupancy", work, cauchy));
    CHECK_FALSE(bench::stage_cost("occupancy", work, smoothing_preset("pixel", 64, 64)));
  }

  TEST_CASE("peaks are above what any program needs, and the device's queue is put back") {
    if (test::is_reduced()) return;
    const Device device = open_device();
    const cl_command_queue before = impl_of(device).queue();
    const bench::Peaks peaks = bench::measure_peaks(device);
    CHECK(peaks.gflops > 0.1);
    CHECK(peaks.gbytes_per_s > 0.1);
    CHECK(impl_of(device).queue() == before);
  }
}

TEST_SUITE("unit") {
  TEST_CASE("kernel files belong to stages") {
    CHECK(bench::stage_of("aggregate_joint.cl") == "aggregate");
    CHECK(bench::stage_of("rasterize.cl") == "rasterize");
    CHECK(bench::stage_of("normals.cl") == "shade");
    const Profile::Launch launches[] = {
        {"scan.cl", "scan_sum", 1}, {"sort.cl", "sort_scatter", 2}, {"scan.cl", "scan_apply", 3}};
    CHECK(bench::milliseconds_by_stage(launches) == std::map<std::string, double>{{"scan", 4}, {"sort", 2}});
  }
}

}  // namespace measure_test
