// Which device is dealt which chunk, in a clock of the test's own.
#include "multi_device/chunk_dealer.hpp"

#include <doctest/doctest.h>

#include <thread>
#include <vector>

namespace chunk_dealer_test {

using dpr::Chunk;
using dpr::ChunkDealer;
using dpr::make_chunks;
using dpr::Pace;

namespace {

Pace pace_of(double seconds_per_view) { return {.is_warm = true, .seconds_per_view = seconds_per_view}; }

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("chunks: all views in order, the last chunk what remains") {
    const std::vector<Chunk> chunks = make_chunks(7, 3);
    REQUIRE(chunks.size() == 3);
    CHECK(chunks[1].first == 3);
    CHECK(chunks[2].first == 6);
    CHECK(chunks[2].last == 7);
  }

  TEST_CASE(
      "paces: the first chunk is not timed, and one that takes long by chance counts no more than double") {
    Pace pace;
    pace.record(100, 1);
    CHECK(pace.seconds_per_view == 0);
    pace.record(4, 2);
    CHECK(pace.seconds_per_view == 2);
    pace.record(1000, 1);
    CHECK(pace.seconds_per_view == 4);
    pace.record(2, 1);
    CHECK(pace.seconds_per_view == 3);
  }

  TEST_CASE("dealing: devices of unknown pace take turns; every chunk is dealt once") {
    std::vector<Pace> paces(2);
    ChunkDealer dealer(make_chunks(4, 1), paces, {false, false});
    CHECK(dealer.take(0) == 0);
    CHECK(dealer.take(1) == 1);
    dealer.finish(0, 0, 1);
    CHECK(dealer.take(0) == 2);
    CHECK(dealer.take(1) == 3);
    dealer.finish(1, 1, 1);
    dealer.finish(1, 3, 1);
    CHECK_FALSE(dealer.is_done());
    dealer.finish(0, 2, 1);
    CHECK(dealer.is_done());
    CHECK_FALSE(dealer.take(0).has_value());
  }

  TEST_CASE("dealing: a slow device gets what it is done with before the others are with all") {
    std::vector<Pace> paces{pace_of(1), pace_of(3.5)};
    ChunkDealer dealer(make_chunks(6, 1), paces, {false, false});
    CHECK(dealer.take(1) == 0);  // 3.5 against the 6 of the other alone
    for (const std::size_t c : {1U, 2U, 3U}) {
      CHECK(dealer.take(0) == c);
      dealer.finish(0, c, 1);
    }
    dealer.finish(1, 0, 3.5);
    // Two are left: the other is done with them in 2. It is dealt none as long as there is the other.
    std::thread waiting([&] { CHECK_FALSE(dealer.take(1).has_value()); });
    for (const std::size_t c : {4U, 5U}) {
      CHECK(dealer.take(0) == c);
      dealer.finish(0, c, 1);
    }
    waiting.join();
    CHECK(dealer.is_done());
  }

  TEST_CASE("dealing: equally fast devices are dealt all to the last chunk") {
    std::vector<Pace> paces(3, pace_of(2));
    ChunkDealer dealer(make_chunks(3, 1), paces, {false, false, false});
    for (const std::size_t d : {0U, 1U, 2U}) CHECK(dealer.take(d) == d);
  }

  TEST_CASE("dealing: a device that was too slow is tried again after a while") {
    std::vector<Pace> paces{pace_of(1), pace_of(100)};
    {
      ChunkDealer dealer(make_chunks(1, 1), paces, {false, false});
      CHECK(dealer.take(0) == 0);
      dealer.finish(0, 0, 1);
      dealer.finish_all(2001);
    }
    CHECK(paces[0].idle_seconds == 0);
    ChunkDealer dealer(make_chunks(3, 1), paces, {false, false});
    CHECK(dealer.take(1) == 0);
    dealer.finish(1, 0, 0.5);
    CHECK(paces[1].idle_seconds == 0);
  }

  TEST_CASE("dealing: the chunk of a lost device is dealt again, also to one that waits and was too slow") {
    std::vector<Pace> paces{pace_of(1), pace_of(100)};
    ChunkDealer dealer(make_chunks(2, 1), paces, {false, false});
    CHECK(dealer.take(0) == 0);
    std::thread waiting([&] {
      while (const auto chunk = dealer.take(1)) dealer.finish(1, *chunk, 100);
    });
    dealer.lose(0, 0);
    CHECK_FALSE(dealer.take(0).has_value());
    waiting.join();
    CHECK(dealer.is_done());
  }

  TEST_CASE("dealing: a slow device does not wait for a faster one that is withdrawn") {
    std::vector<Pace> paces{pace_of(1), pace_of(100)};
    ChunkDealer dealer(make_chunks(3, 1), paces, {false, false});
    std::thread waiting([&] {
      while (const auto chunk = dealer.take(1)) dealer.finish(1, *chunk, 100);
    });
    dealer.withdraw(0);
    CHECK_FALSE(dealer.take(0).has_value());
    waiting.join();
    CHECK(dealer.is_done());
  }

  TEST_CASE("dealing: once all are withdrawn nothing more is dealt, and what was is ended") {
    std::vector<Pace> paces(2);
    ChunkDealer dealer(make_chunks(3, 1), paces, {false, false});
    CHECK(dealer.take(1) == 0);
    for (const std::size_t d : {0U, 1U}) dealer.withdraw(d);
    dealer.finish(1, 0, 1);
    for (const std::size_t d : {0U, 1U}) CHECK_FALSE(dealer.take(d).has_value());
    CHECK_FALSE(dealer.is_done());
  }
}

}  // namespace chunk_dealer_test
