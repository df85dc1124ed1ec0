// CGAL's split_long_edges is not used: it needs a manifold halfedge mesh, knows positions only (no visitor that could
// interpolate attributes), and would tear or merge what glTF files are made of, seams and triangle soups.
#include "pathcut/densify.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <unordered_map>

#include "core/mesh_attributes.h"

namespace nephroid {

namespace {

// Of an edge that is worth splitting: where coordinates are rounded coarsely, splitting would go on for ever.
constexpr double largest_half = 0.75;

/// One object's wish for its mesh.
struct Wish {
    const Object* object = nullptr;
    glm::dmat3 to_world{1.0};
    double longest = 0.0;  ///< Metres, in world space.
};

using Wishes = std::vector<Wish>;

std::string describe_too_many(const Scene& scene, const Wishes& wishes) {
    const Wish& strictest = *std::min_element(wishes.begin(), wishes.end(),
                                              [](const Wish& a, const Wish& b) { return a.longest < b.longest; });
    char text[160];
    std::snprintf(text, sizeof(text), "extras.densify = %g m adds more than %zu million triangles; ", strictest.longest,
                  max_added_triangles / 1'000'000);
    return scene.file + ": object " + strictest.object->name + ": " + text + "choose a longer edge length";
}

/// The surface's area as a lower bound: no triangle with edges up to `longest` has more than the equilateral one.
double least_triangle_count(const Mesh& mesh, const Wish& wish) {
    constexpr double equilateral_area = 0.4330127018922193;
    double count = 0.0;
    for (const Triangle& triangle : mesh.triangles) {
        std::array<Vec3d, 3> p;
        for (size_t i = 0; i < 3; ++i) p[i] = wish.to_world * Vec3d(mesh.positions[triangle[i]]) / wish.longest;
        const double area = 0.5 * glm::length(glm::cross(p[1] - p[0], p[2] - p[0]));
        const double extent = std::max(glm::length(p[1] - p[0]), glm::length(p[2] - p[0]));
        if (!std::isnan(area)) count += std::max({1.0, area / equilateral_area, extent});
    }
    return count;
}

/// Splits the triangles of one mesh, one after the other. A vertex in the middle of an edge is made once.
class EdgeSplitter {
  public:
    EdgeSplitter(Mesh& mesh, const Wishes& wishes, size_t max_triangles)
        : mesh_(mesh), wishes_(wishes), max_triangles_(max_triangles) {}

    /// False, with the mesh in an unspecified state, where there would be more than max_triangles.
    bool split() {
        const size_t first_new = mesh_.positions.size();
        for (size_t i = 0; i < mesh_.triangles.size(); ++i) {
            if (!split(mesh_.triangles[i])) return false;
        }
        if (mesh_.positions.size() == first_new) return true;
        mesh_.coarse_triangles = mesh_.triangles.size();
        mesh_.triangles = std::move(result_);
        normalise();
        mesh_.positions.reserve(mesh_.positions.size() + 1);  // Embree may read 4 bytes past the last vertex.
        return true;
    }

  private:
    using Chain = std::vector<uint32_t>;

    bool split(const Triangle& coarse) {
        pending_.push_back(coarse);
        while (!pending_.empty()) {
            const Triangle triangle = pending_.back();
            pending_.pop_back();
            std::array<double, 3> lengths{};
            for (size_t k = 0; k < 3; ++k) lengths[k] = excess(triangle[k], triangle[(k + 1) % 3]);
            const auto long_edges = std::count_if(lengths.begin(), lengths.end(), [](double l) { return l > 1.0; });
            if (long_edges == 0) {
                result_.push_back(triangle);
            } else if (long_edges == 2) {
                const auto shortest = std::min_element(lengths.begin(), lengths.end()) - lengths.begin();
                split_strip(triangle, static_cast<size_t>(shortest));
            } else {
                const auto longest = std::max_element(lengths.begin(), lengths.end()) - lengths.begin();
                bisect(triangle, static_cast<size_t>(longest));
            }
            if (result_.size() + pending_.size() > max_triangles_) return false;
        }
        return true;
    }

    /// Cuts the triangle in two at the middle of edge k, its longest: this makes no angle much smaller.
    void bisect(const Triangle& triangle, size_t k) {
        const uint32_t a = triangle[k], b = triangle[(k + 1) % 3], c = triangle[(k + 2) % 3];
        const uint32_t middle = middle_of(a, b);
        pending_.push_back({a, middle, c});
        pending_.push_back({middle, b, c});
    }

    /// Edge k is short enough and the two others are not: splits them all the way and fills the space between with a
    /// strip. Halving step by step would make n^1.6 instead of 2 n triangles of a splinter n edges long.
    void split_strip(const Triangle& triangle, size_t k) {
        const uint32_t apex = triangle[(k + 2) % 3];
        const Chain left = chain_between(triangle[k], apex), right = chain_between(triangle[(k + 1) % 3], apex);
        size_t i = 0, j = 0;
        const size_t last_i = left.size() - 2, last_j = right.size() - 2;  // Before the apex, where both chains end.
        while (i < last_i || j < last_j) {
            if (j == last_j ||
                (i < last_i && relative_length(left[i + 1], right[j]) < relative_length(left[i], right[j + 1]))) {
                pending_.push_back({left[i], right[j], left[i + 1]});
                ++i;
            } else {
                pending_.push_back({left[i], right[j], right[j + 1]});
                ++j;
            }
        }
        pending_.push_back({left[i], right[j], apex});
    }

    /// The vertices from a to b, both included, after all splitting of that edge.
    Chain chain_between(uint32_t a, uint32_t b) {
        Chain chain{a}, targets{b};
        while (!targets.empty()) {
            if (excess(chain.back(), targets.back()) > 1.0) {
                targets.push_back(middle_of(chain.back(), targets.back()));
            } else {
                chain.push_back(targets.back());
                targets.pop_back();
            }
        }
        return chain;
    }

    Vec3 middle_position(uint32_t a, uint32_t b) const {
        return Vec3((Vec3d(mesh_.positions[a]) + Vec3d(mesh_.positions[b])) * 0.5);
    }

    /// The distance of two points in units of what is wished for; the same from both ends.
    double relative_length(const Vec3& a, const Vec3& b) const {
        double longest = 0.0;
        for (const Wish& wish : wishes_) {
            longest = std::max(longest, glm::length(wish.to_world * (Vec3d(b) - Vec3d(a))) / wish.longest);
        }
        return longest;
    }
    double relative_length(uint32_t a, uint32_t b) const {
        return relative_length(mesh_.positions[a], mesh_.positions[b]);
    }

    /// The relative length of an edge that can be split; zero where floats are too coarse to shorten it.
    double excess(uint32_t a, uint32_t b) const {
        const double length = relative_length(a, b);
        if (!(length > 1.0)) return length;
        const Vec3 middle = middle_position(a, b);
        const double longer_half =
            std::max(relative_length(mesh_.positions[a], middle), relative_length(middle, mesh_.positions[b]));
        return longer_half <= largest_half * length && std::isfinite(length) ? length : 0.0;
    }

    uint32_t middle_of(uint32_t a, uint32_t b) {
        const uint64_t key = uint64_t{std::min(a, b)} << 32U | std::max(a, b);
        const auto [found, is_new] = middles_.try_emplace(key, static_cast<uint32_t>(mesh_.positions.size()));
        if (is_new) append_middle(a, b);
        return found->second;
    }

    /// Normals and tangents keep their length until the end, so that the direction at each new vertex is that of the
    /// coarse triangle's linear interpolation.
    void append_middle(uint32_t a, uint32_t b) {
        mesh_.positions.push_back(middle_position(a, b));
        append_mean(mesh_.normals, a, b);
        for (auto& uvs : mesh_.uvs) append_mean(uvs, a, b);
        append_mean(mesh_.colors, a, b);
        append_mean(mesh_.tangents, a, b);
        if (mesh_.tangents.empty()) return;
        Vec4& tangent = mesh_.tangents.back();
        const Vec4& first = mesh_.tangents[std::min(a, b)];
        if (!(glm::length(Vec3(tangent)) > 1e-6F)) tangent = first;  // Opposite tangents: either will do.
        tangent.w = first.w;
    }

    template <typename Vector>
    static void append_mean(std::vector<Vector>& values, uint32_t a, uint32_t b) {
        if (values.empty()) return;
        const Vector mean = (values[a] + values[b]) * 0.5F;
        values.push_back(mean);
    }

    void normalise() {
        normalize_normals(mesh_);  // Opposite normals cancel: those vertices get the mean of their triangles.
        for (Vec4& tangent : mesh_.tangents) {
            tangent = Vec4(normalize_or(Vec3(tangent), Vec3(1.0F, 0.0F, 0.0F)), tangent.w);
        }
    }

    Mesh& mesh_;
    const Wishes& wishes_;
    const size_t max_triangles_;
    std::unordered_map<uint64_t, uint32_t> middles_;  ///< Pairs of vertices to the vertex between them.
    std::vector<Triangle> pending_, result_;
};

}  // namespace

void densify_objects(Scene& scene) {
    std::vector<Wishes> wishes(scene.meshes.size());
    for (const Object& object : scene.objects) {
        if (!(object.densify > 0.0F)) continue;
        wishes[static_cast<size_t>(object.mesh)].push_back(
            {&object, glm::dmat3(Mat3(object.to_world)), static_cast<double>(object.densify)});
    }
    size_t budget = max_added_triangles;
    for (size_t i = 0; i < scene.meshes.size(); ++i) {
        if (wishes[i].empty()) continue;
        Mesh& mesh = scene.meshes[i];
        const size_t before = mesh.triangles.size();
        const auto most = static_cast<double>(before + budget);
        const bool is_possible = std::all_of(wishes[i].begin(), wishes[i].end(), [&](const Wish& wish) {
            return least_triangle_count(mesh, wish) <= most;
        });
        if (!is_possible || !EdgeSplitter(mesh, wishes[i], before + budget).split()) {
            throw Error(ExitCode::invalid_input, describe_too_many(scene, wishes[i]));
        }
        budget -= mesh.triangles.size() - before;
    }
}

}  // namespace nephroid
