// Variables by which a launcher tells processes that they train together.
#include "learn/ranks.hpp"

#include <doctest/doctest.h>

#include <map>
#include <string>

#include "dpr/error.hpp"
#include "support/messages.hpp"

namespace dpr::test::ranks_test {
namespace {

using learn::Ranks;
using Variables = std::map<std::string, std::string>;

Ranks ranks_of(const Variables& variables) {
  return learn::ranks_of([&](const char* name) {
    const auto found = variables.find(name);
    return found == variables.end() ? nullptr : found->second.c_str();
  });
}

Variables complete() {
  return {{"RANK", "3"},
          {"WORLD_SIZE", "4"},
          {"LOCAL_RANK", "1"},
          {"MASTER_ADDR", "node7"},
          {"MASTER_PORT", "29500"}};
}

std::string message(const Variables& variables) {
  return message_of<InvalidArgument>([&] { ranks_of(variables); });
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("ranks: as torchrun and srun set them") {
    CHECK(ranks_of({}).count == 1);
    CHECK(ranks_of({{"SLURM_PROCID", "1"}, {"SLURM_NTASKS", "2"}}).count == 1);  // any job of Slurm
    const Ranks found = ranks_of(complete());
    CHECK(found.rank == 3);
    CHECK(found.count == 4);
    CHECK(found.local_rank == 1);
    CHECK(found.address == "node7");
    CHECK(found.port == 29500);
    CHECK_FALSE(found.launcher_listens);
    Variables elastic = complete();
    elastic["TORCHELASTIC_USE_AGENT_STORE"] = "True";
    elastic["TORCHELASTIC_RESTART_COUNT"] = "2";
    CHECK(ranks_of(elastic).launcher_listens);
    CHECK(ranks_of(elastic).restarts == "2");
    const Ranks slurm = ranks_of({{"SLURM_PROCID", "1"},
                                  {"SLURM_NTASKS", "2"},
                                  {"SLURM_LOCALID", "1"},
                                  {"MASTER_ADDR", "node7"},
                                  {"MASTER_PORT", "29500"}});
    CHECK(slurm.rank == 1);
    CHECK(slurm.count == 2);
    CHECK(slurm.local_rank == 1);
  }

  TEST_CASE("ranks: every part of a list belongs to one rank") {
    for (const std::size_t total : {0, 1, 7, 24}) {
      for (const int count : {1, 2, 3, 8}) {
        std::size_t next = 0;
        for (int rank = 0; rank < count; ++rank) {
          Ranks ranks;
          ranks.rank = rank;
          ranks.count = count;
          CHECK(ranks.first(total) == next);
          next = ranks.last(total);
        }
        CHECK(next == total);
      }
    }
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("ranks: an environment that is not complete, or no numbers") {
    for (const auto& [name, value] : complete()) {
      if (name == "LOCAL_RANK") continue;  // needed by nobody but several devices of a machine
      CAPTURE(name);
      Variables variables = complete();
      variables.erase(name);
      CHECK(contains(message(variables), name + " (environment): got nothing"));
      variables[name] = "";
      CHECK(contains(message(variables), name + " (environment): got nothing"));
      CHECK_FALSE(contains(message({{name, value}}), name + " (environment): got nothing"));
    }
    const std::pair<const char*, const char*> wrong[] = {
        {"RANK", "4"},       {"RANK", "-1"},        {"RANK", "one"},          {"RANK", "1 "},
        {"WORLD_SIZE", "0"}, {"LOCAL_RANK", "9"},   {"MASTER_PORT", "70000"}, {"MASTER_PORT", "0"},
        {"WORLD_SIZE", "2"}, {"WORLD_SIZE", "1e3"}, {"MASTER_PORT", "ssh"}};
    for (const auto& [name, value] : wrong) {
      CAPTURE(name);
      CAPTURE(value);
      Variables variables = complete();
      variables[name] = value;
      CHECK(contains(message(variables), "(environment): got \""));
    }
  }
}

}  // namespace dpr::test::ranks_test
