#include "device_ranking.hpp"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "cli/provenance.hpp"
#include "device/kernel.hpp"
#include "dpr/error.hpp"
#include "environment.hpp"
#include "kernels/scan.hpp"
#include "results_file.hpp"

namespace dpr::cli {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

double median(std::vector<double> values) {
  return bench::quartiles(std::move(values))["median"].get<double>();
}

/// Microseconds from the launch of a small kernel to the end of the host's wait for it.
double launch_microseconds(const Device& device) {
  constexpr int k_launches = 200;
  Launcher<kernel::scan_sum> launch(impl_of(device));
  const std::vector<cl_uint> one{1};
  const Buffer<cl_uint> value(impl_of(device), std::span<const cl_uint>(one));
  Buffer<cl_uint> result(impl_of(device), 1);
  std::vector<double> times;
  for (int i = 0; i < k_launches; ++i) {
    const Clock::time_point start = Clock::now();
    launch.in_groups(1, kernel::scan_sum{.count = 1U, .present = value, .values = value, .sums = result});
    check_cl(impl_of(device).queue.finish(), "clFinish");
    times.push_back(seconds_since(start) * 1e6);
  }
  return median(times);
}

/// 1e9 bytes a second to the device and back.
double transfer_rate(const Device& device) {
  constexpr std::size_t k_bytes = std::size_t{64} << 20;
  constexpr int k_transfers = 5;
  std::vector<cl_uint> values(k_bytes / sizeof(cl_uint));
  Buffer<cl_uint> buffer(impl_of(device), values.size());
  std::vector<double> times;
  for (int i = 0; i < k_transfers; ++i) {
    const Clock::time_point start = Clock::now();
    buffer.upload(impl_of(device), values);
    buffer.download(values);
    times.push_back(seconds_since(start));
  }
  return 2 * static_cast<double>(k_bytes) / median(times) * 1e-9;
}

Json measure_device(const DeviceInfo& info, const bench::Workload& workload,
                    const bench::MeasureOptions& options) {
  Json row{{"device", {{"index", info.index}, {"name", info.name}}}};
  try {
    const Device device = dpr::open_device(std::to_string(info.index));
    row["device"].update(provenance(device)["device"]);
    row["notes"] = device.info().passed_over;
    row["first_image_ms"] = bench::first_image_ms(device);
    row["launch_us"] = launch_microseconds(device);
    row["transfer_gbytes_per_s"] = transfer_rate(device);
    row.update(
        bench::measure(device, bench::measure_peaks(device), workload, workload.variants.front(), options));
  } catch (const Error& error) {
    row.update({{"status", "failed"}, {"reason", error.what()}});
  }
  return row;
}

void print(const Json& row, std::size_t rank) {
  const Json& device = row["device"];
  const std::string name = device["name"].get<std::string>();
  if (!bench::is_measured(row)) {
    std::printf("   -  %zu: %s: %s\n", device["index"].get<std::size_t>(), name.c_str(),
                row["reason"].get<std::string>().c_str());
    return;
  }
  std::printf("%4zu  %-10.3f %-12.0f %-10.1f %-10.2f %zu: %s (%s, driver %s, %u lanes)\n", rank,
              bench::total_ms(row), row["first_image_ms"].get<double>(), row["launch_us"].get<double>(),
              row["transfer_gbytes_per_s"].get<double>(), device["index"].get<std::size_t>(), name.c_str(),
              device["platform"].get<std::string>().c_str(), device["driver"].get<std::string>().c_str(),
              device["lanes"].get<unsigned>());
}

}  // namespace

void rank_devices(const BenchMeasureOptions& options, const CommonOptions& common) {
  if (options.workloads.size() > 1)
    throw InvalidArgument("--workload (command line)", "several", "one beside --devices all");
  const std::string name = options.workloads.empty() ? "sphere256" : options.workloads.front();
  const bench::Workload workload = bench::make_workloads(name).front();
  std::vector<Json> rows;
  for (const DeviceInfo& info : list_devices()) rows.push_back(measure_device(info, workload, options.each));
  std::ranges::stable_sort(rows, {}, [](const Json& row) {
    return bench::is_measured(row) ? bench::total_ms(row) : std::numeric_limits<double>::infinity();
  });
  if (!common.quiet) {
    std::printf("%s, forward and backward\n", name.c_str());
    std::printf("rank  %-10s %-12s %-10s %-10s device\n", "frame, ms", "first, ms", "launch, us", "GB/s");
    for (std::size_t i = 0; i < rows.size(); ++i) print(rows[i], i + 1);
  }
  if (!options.output.empty())
    write_json(options.output, {{"schema", "dpr.devices"},
                                {"commit", commit()},
                                {"environment", bench::environment()},
                                {"devices", rows}});
}

}  // namespace dpr::cli
