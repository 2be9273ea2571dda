#include "mesh/face_pieces.hpp"

#include <algorithm>
#include <string>
#include <unordered_map>
#include <utility>

#include "dpr/error.hpp"
#include "mesh/weld.hpp"

namespace dpr {
namespace {

// Then the middle's barycentrics would need more bits than single precision has.
constexpr int k_most_halvings = 24;

/// A point of the surface, whose place all faces know that have it.
struct Corner {
  glm::vec3 barycentrics;
  std::uint32_t place;
};

class FaceCutter {
 public:
  FaceCutter(std::span<const glm::vec3> positions, std::span<const glm::uvec3> faces, std::size_t most_new)
      : places_(positions.begin(), positions.end()), most_(faces.size() + most_new) {
    const std::vector<glm::uvec3> welded = weld(faces, weld(positions));
    pieces_.reserve(welded.size());
    for (std::uint32_t f = 0; f < welded.size(); ++f) {
      const glm::uvec3& p = welded[f];
      pieces_.push_back({f, {{{{1, 0, 0}, p.x}, {{0, 1, 0}, p.y}, {{0, 0, 1}, p.z}}}, true});
    }
  }

  /// Halves all sides that are too long now; false where there are none.
  bool halve(const SideTest& find_long_sides) {
    middles_.clear();
    for (const Piece& piece : pieces_) {
      if (!piece.is_new) continue;
      const auto& c = piece.corners;
      std::array<bool, 3> is_too_long{};
      find_long_sides({places_[c[0].place], places_[c[1].place], places_[c[2].place]}, is_too_long);
      for (std::size_t side = 0; side < 3; ++side)
        if (is_too_long[side]) add_middle(c[side].place, c[(side + 1) % 3].place);
    }
    if (middles_.empty()) return false;
    for (Piece& piece : std::exchange(pieces_, {})) cut(piece);
    return true;
  }

  std::vector<FacePiece> pieces() const {
    std::vector<FacePiece> result;
    result.reserve(pieces_.size());
    for (const Piece& p : pieces_) {
      const auto& c = p.corners;
      result.push_back({p.face, {c[0].barycentrics, c[1].barycentrics, c[2].barycentrics}});
    }
    return result;
  }

 private:
  struct Piece {
    std::uint32_t face;
    std::array<Corner, 3> corners;
    bool is_new;  ///< not tested yet
  };

  static std::uint64_t key(std::uint32_t a, std::uint32_t b) {
    return std::uint64_t{std::min(a, b)} << 32U | std::max(a, b);
  }

  void add_middle(std::uint32_t a, std::uint32_t b) {
    if (a == b || !middles_.emplace(key(a, b), static_cast<std::uint32_t>(places_.size())).second) return;
    places_.push_back(0.5 * (places_[a] + places_[b]));
  }

  void add(std::uint32_t face, const Corner& a, const Corner& b, const Corner& c) {
    if (pieces_.size() >= most_) {
      throw InvalidArgument("tolerance (subdivision for a lens)",
                            "one that takes more than " + std::to_string(most_) + " faces",
                            "a larger one, more new faces allowed, or a camera of less distortion");
    }
    pieces_.push_back({face, {a, b, c}, true});
  }

  double distance(const Corner& a, const Corner& b) const {
    return glm::distance(places_[a.place], places_[b.place]);
  }

  /// Into one piece more than sides of it are halved.
  void cut(const Piece& piece) {
    std::array<Corner, 3> middle{};
    std::array<bool, 3> is_halved{};
    int halved = 0;
    const auto& corners = piece.corners;
    for (std::size_t side = 0; side < 3; ++side) {
      const Corner &from = corners[side], &to = corners[(side + 1) % 3];
      const auto found = middles_.find(key(from.place, to.place));
      if (found == middles_.end()) continue;
      is_halved[side] = true;
      middle[side] = {0.5F * (from.barycentrics + to.barycentrics), found->second};
      ++halved;
    }
    if (halved == 0) {
      pieces_.push_back(piece);
      pieces_.back().is_new = false;
      return;
    }
    // Turned so that of the halved sides the first is side 0, and the other of two is side 1.
    std::size_t first = 0;
    if (halved == 1) first = is_halved[0] ? 0 : is_halved[1] ? 1 : 2;
    if (halved == 2) first = !is_halved[2] ? 0 : !is_halved[0] ? 1 : 2;
    const std::size_t second = (first + 1) % 3, third = (first + 2) % 3;
    const Corner &a = corners[first], &b = corners[second], &c = corners[third];
    const Corner &ab = middle[first], &bc = middle[second], &ca = middle[third];
    const std::uint32_t face = piece.face;
    if (halved == 1) {
      add(face, a, ab, c);
      add(face, ab, b, c);
      return;
    }
    add(face, ab, b, bc);
    if (halved == 3) {
      add(face, a, ab, ca);
      add(face, ca, bc, c);
      add(face, ab, bc, ca);
    } else if (distance(a, bc) <= distance(ab, c)) {
      add(face, a, ab, bc);
      add(face, a, bc, c);
    } else {
      add(face, a, ab, c);
      add(face, ab, bc, c);
    }
  }

  std::vector<glm::dvec3> places_;
  std::size_t most_;
  std::vector<Piece> pieces_;
  std::unordered_map<std::uint64_t, std::uint32_t> middles_;  // place of an edge's middle, by its ends
};

}  // namespace

std::vector<FacePiece> cut_faces(std::span<const glm::vec3> positions, std::span<const glm::uvec3> faces,
                                 const SideTest& find_long_sides, std::size_t most_new) {
  FaceCutter cutter(positions, faces, most_new);
  for (int i = 0; i < k_most_halvings && cutter.halve(find_long_sides);) ++i;
  return cutter.pieces();
}

}  // namespace dpr
