#include "learn/checkpoint.hpp"

#include <nlohmann/json.hpp>

#include "base/input_file.hpp"
#include "base/output_file.hpp"
#include "dpr/error.hpp"

namespace dpr::learn {
namespace {

// Description of the layers of network.cpp; change both together.
constexpr const char* k_architecture =
    "dpr single-image reconstruction 1: 64-128-256, 1024-1024-512, 642 vertices";

template <typename Record>
at::Tensor to_tensor(const std::vector<Record>& records) {
  constexpr std::int64_t k_columns = sizeof(Record) / sizeof(double);
  at::Tensor tensor = torch::empty({static_cast<std::int64_t>(records.size()), k_columns}, torch::kDouble);
  if (!records.empty())
    std::memcpy(tensor.data_ptr<double>(), records.data(), records.size() * sizeof(Record));
  return tensor;
}

template <typename Record>
std::vector<Record> to_records(const at::Tensor& tensor) {
  constexpr std::int64_t k_columns = sizeof(Record) / sizeof(double);
  TORCH_CHECK(tensor.scalar_type() == torch::kDouble && tensor.dim() == 2 && tensor.size(1) == k_columns);
  std::vector<Record> records(static_cast<std::size_t>(tensor.size(0)));
  const at::Tensor values = tensor.contiguous();
  if (!records.empty())
    std::memcpy(records.data(), values.data_ptr<double>(), records.size() * sizeof(Record));
  return records;
}

std::unique_ptr<torch::optim::Adam> make_optimizer(Network& network, double learning_rate) {
  return std::make_unique<torch::optim::Adam>(
      network->parameters(), torch::optim::AdamOptions(learning_rate).betas(std::make_tuple(0.9, 0.999)));
}

at::Tensor read_tensor(torch::serialize::InputArchive& archive, const std::string& name) {
  at::Tensor tensor;
  archive.read(name, tensor);
  return tensor;
}

/// The description of a checkpoint; throws c10::Error or Json's exceptions where there is none.
nlohmann::json read_description(torch::serialize::InputArchive& archive) {
  c10::IValue text;
  archive.read("description", text);
  return nlohmann::json::parse(text.toStringRef());
}

/// Reads the network's weights. Throws c10::Error unless they are as many as it has, and finite.
void read_network(torch::serialize::InputArchive& archive, Network& network) {
  const auto tensors = [&] {
    std::vector<at::Tensor> all = network->parameters();
    for (const at::Tensor& buffer : network->buffers()) all.push_back(buffer);
    return all;
  };
  std::vector<std::vector<std::int64_t>> shapes;
  for (const at::Tensor& tensor : tensors()) shapes.push_back(tensor.sizes().vec());
  torch::serialize::InputArchive part;
  archive.read("network", part);
  network->load(part);  // takes tensors of any shape
  auto shape = shapes.begin();
  for (const at::Tensor& tensor : tensors())
    TORCH_CHECK(tensor.sizes().vec() == *shape++ && tensor.isfinite().all().item<bool>());
}

LoadedCheckpoint read_checkpoint(const std::filesystem::path& file, torch::serialize::InputArchive& archive,
                                 double learning_rate) {
  const nlohmann::json description = read_description(archive);
  const std::string architecture = description.at("architecture");
  if (architecture != k_architecture) {
    throw IoError(file, "is a checkpoint of another architecture: \"" + architecture + "\", not \"" +
                            k_architecture + "\"");
  }
  const NetworkOptions options{description.at("palette")};
  LoadedCheckpoint loaded = start(options, description.at("method"), description.at("seed"), learning_rate);
  loaded.checkpoint.steps = to_records<StepRecord>(read_tensor(archive, "steps"));
  loaded.checkpoint.validations = to_records<ValidationRecord>(read_tensor(archive, "validations"));
  loaded.checkpoint.settings = description.at("settings");
  read_network(archive, loaded.network);
  torch::serialize::InputArchive moments;
  archive.read("optimizer", moments);
  loaded.optimizer->load(moments);
  for (torch::optim::OptimizerParamGroup& group : loaded.optimizer->param_groups()) {
    group.options().set_lr(learning_rate);
  }
  return loaded;
}

template <typename Open>
LoadedCheckpoint load(const std::filesystem::path& file, double learning_rate, Open open) {
  try {
    torch::serialize::InputArchive archive;
    open(archive);
    return read_checkpoint(file, archive, learning_rate);
  } catch (const Error&) {
    throw;
  } catch (const std::exception&) {  // torch has several kinds for an archive that it does not understand
    throw IoError(file, "is damaged, or no checkpoint of dpr learn");
  }
}

}  // namespace

void save_checkpoint(const std::filesystem::path& file, const Checkpoint& checkpoint, const Network& network,
                     const torch::optim::Adam& optimizer) {
  const nlohmann::json description = {{"architecture", k_architecture},
                                      {"palette", checkpoint.architecture.palette},
                                      {"method", checkpoint.method},
                                      {"seed", checkpoint.seed},
                                      {"settings", checkpoint.settings}};
  torch::serialize::OutputArchive archive, part, moments;
  archive.write("description", c10::IValue(description.dump()));
  archive.write("steps", to_tensor(checkpoint.steps));
  archive.write("validations", to_tensor(checkpoint.validations));
  network->save(part);
  archive.write("network", part);
  optimizer.save(moments);
  archive.write("optimizer", moments);
  OutputFile output(file);
  // Torch's writer terminates the process where writing fails, so it is not told: commit() knows.
  archive.save_to([&](const void* bytes, std::size_t count) {
    output.write(bytes, count);
    return count;
  });
  output.commit();
}

LoadedCheckpoint start(const NetworkOptions& architecture, const std::string& method, std::uint64_t seed,
                       double learning_rate) {
  torch::manual_seed(seed);
  LoadedCheckpoint fresh;
  fresh.checkpoint.architecture = architecture;
  fresh.checkpoint.method = method;
  fresh.checkpoint.seed = seed;
  fresh.network = Network(architecture);
  fresh.optimizer = make_optimizer(fresh.network, learning_rate);
  return fresh;
}

LoadedCheckpoint load_checkpoint(const std::filesystem::path& file, double learning_rate) {
  require_file(file);
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {  // torch reads it back and forth
    throw IoError(file, "is a pipe or a device, expected a regular file");
  }
  return load(file, learning_rate,
              [&](torch::serialize::InputArchive& archive) { archive.load_from(file.string()); });
}

LoadedCheckpoint load_checkpoint(const std::filesystem::path& file, const std::string& bytes,
                                 double learning_rate) {
  return load(file, learning_rate, [&](torch::serialize::InputArchive& archive) {
    archive.load_from(bytes.data(), bytes.size());
  });
}

}  // namespace dpr::learn
