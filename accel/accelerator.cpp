#include "accel/accelerator.h"

#include <string>
#include <vector>

#include "accel/alpha_filter.h"
#include "accel/embree.h"

namespace nephroid {

namespace {

/// Embree reports errors through a callback without unwinding; the first one is kept and thrown after the build.
struct DeviceErrors {
    std::string first;

    static void record(void* self, RTCError, const char* message) {
        auto& errors = *static_cast<DeviceErrors*>(self);
        if (errors.first.empty()) errors.first = message != nullptr ? message : "unknown";
    }
};

RTCGeometry make_triangle_geometry(RTCDevice device, const Mesh& mesh) {
    const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, mesh.positions.data(), 0,
                               sizeof(Vec3), mesh.positions.size());
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangles.data(), 0,
                               sizeof(Triangle), mesh.triangles.size());
    return geometry;
}

}  // namespace

struct Accelerator::Implementation {
    DeviceErrors errors;
    RTCDevice device = nullptr;
    RTCScene top = nullptr;
    std::vector<RTCScene> instanced;           // Per mesh: its own scene where several objects share it.
    std::vector<AlphaFilterData> filter_data;  // Per mesh; stable addresses for Embree.
    uint32_t object_count = 0;
    bool has_instances = false;
    std::vector<uint32_t> sphere_lights;  // Indices into Scene::lights.

    ~Implementation() {
        for (const RTCScene scene : instanced) {
            if (scene != nullptr) rtcReleaseScene(scene);
        }
        if (top != nullptr) rtcReleaseScene(top);
        if (device != nullptr) rtcReleaseDevice(device);
    }

    RTCGeometry mesh_geometry(const Scene& scene, size_t mesh_index) {
        const Mesh& mesh = scene.meshes[mesh_index];
        const RTCGeometry geometry = make_triangle_geometry(device, mesh);
        const Material& material = scene.materials[static_cast<size_t>(mesh.material)];
        if (material.alpha_mode != AlphaMode::opaque) {
            filter_data[mesh_index] = {&scene, &mesh, &material};
            attach_alpha_filter(geometry, filter_data[mesh_index]);
        }
        rtcCommitGeometry(geometry);
        return geometry;
    }

    void attach(RTCGeometry geometry, RTCScene scene, uint32_t id) {
        rtcAttachGeometryByID(scene, geometry, id);
        rtcReleaseGeometry(geometry);
    }

    void add_object(const Scene& scene, const std::vector<uint32_t>& use_count, uint32_t id) {
        const Object& object = scene.objects[id];
        const auto mesh = static_cast<size_t>(object.mesh);
        if (use_count[mesh] == 1 && object.to_world == Mat4(1.0F)) {
            attach(mesh_geometry(scene, mesh), top, id);
            return;
        }
        has_instances = true;
        if (instanced[mesh] == nullptr) {
            instanced[mesh] = rtcNewScene(device);
            rtcSetSceneFlags(instanced[mesh], RTC_SCENE_FLAG_ROBUST);
            attach(mesh_geometry(scene, mesh), instanced[mesh], 0);
            rtcCommitScene(instanced[mesh]);
        }
        const RTCGeometry instance = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE);
        rtcSetGeometryInstancedScene(instance, instanced[mesh]);
        rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, &object.to_world[0][0]);
        rtcCommitGeometry(instance);
        attach(instance, top, id);
    }

    void add_sphere_lights(const Scene& scene) {
        for (size_t i = 0; i < scene.lights.size(); ++i) {
            if (scene.lights[i].kind == LightKind::sphere) sphere_lights.push_back(static_cast<uint32_t>(i));
        }
        if (sphere_lights.empty()) return;
        const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
        auto* spheres = static_cast<Vec4*>(rtcSetNewGeometryBuffer(
            geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, sizeof(Vec4), sphere_lights.size()));
        if (spheres != nullptr) {
            for (const uint32_t light : sphere_lights) {
                *spheres++ = Vec4(scene.lights[light].position, scene.lights[light].radius);
            }
        }
        rtcCommitGeometry(geometry);
        attach(geometry, top, object_count);
    }

    /// Maps Embree's ids to ours.
    void translate(uint32_t geometry, uint32_t instance, uint32_t& object, uint32_t& primitive) const {
        object = instance != RTC_INVALID_GEOMETRY_ID ? instance : geometry;
        if (object == object_count) {
            object += sphere_lights[primitive];
            primitive = 0;
        }
    }
};

Accelerator::Accelerator(const Scene& scene, int threads) : implementation_(std::make_unique<Implementation>()) {
    Implementation& self = *implementation_;
    self.device = rtcNewDevice(("threads=" + std::to_string(threads)).c_str());
    if (self.device == nullptr)
        throw Error(ExitCode::render_failed, "Embree: no device; check the processor and memory");
    rtcSetDeviceErrorFunction(self.device, DeviceErrors::record, &self.errors);

    std::vector<uint32_t> use_count(scene.meshes.size(), 0);
    for (const Object& object : scene.objects) ++use_count[static_cast<size_t>(object.mesh)];
    self.object_count = static_cast<uint32_t>(scene.objects.size());
    self.instanced.resize(scene.meshes.size(), nullptr);
    self.filter_data.resize(scene.meshes.size());
    self.top = rtcNewScene(self.device);
    // Without it rays slip through the edges that two triangles share (about one in a million on a closed sphere). It
    // costs no time: docs/performance.md.
    rtcSetSceneFlags(self.top, RTC_SCENE_FLAG_ROBUST);
    for (uint32_t id = 0; id < self.object_count; ++id) self.add_object(scene, use_count, id);
    self.add_sphere_lights(scene);
    rtcCommitScene(self.top);
    if (!self.errors.first.empty()) {
        throw Error(ExitCode::render_failed,
                    scene.file + ": Embree: " + self.errors.first + "; free memory or reduce the scene");
    }
}

Accelerator::~Accelerator() = default;

namespace {

RTCRay make_query(const Ray& ray) {
    const Vec3& o = ray.origin;
    const Vec3& d = ray.direction;
    return {o.x, o.y, o.z, 0.0F, d.x, d.y, d.z, 0.0F, ray.t_max, ~0U, 0, 0};
}

}  // namespace

Hit Accelerator::intersect(const Ray& ray) const {
    alignas(16) RTCRayHit query;
    query.ray = make_query(ray);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    embree::Context context(embree::Coherence::incoherent);
    embree::intersect1(implementation_->top, context, query);
    Hit hit;
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return hit;
    hit.primitive = query.hit.primID;
    implementation_->translate(query.hit.geomID, query.hit.instID[0], hit.object, hit.primitive);
    hit.u = query.hit.u;
    hit.v = query.hit.v;
    hit.t = query.ray.tfar;
    return hit;
}

bool Accelerator::occluded(const Ray& ray) const {
    alignas(16) RTCRay query = make_query(ray);
    embree::Context context(embree::Coherence::incoherent);
    embree::occluded1(implementation_->top, context, query);
    return query.tfar < 0.0F;
}

namespace {

/// Copies packet `first` of a batch into Embree's ray layout and marks the rays that exist.
void load_packet(const RayBatch& rays, size_t first, RTCRay16& packet, int* valid) {
    const auto copy = [first](const AlignedArray<float>& from, float* to) {
        std::copy_n(from.data() + first, packet_width, to);
    };
    copy(rays.origin_x, packet.org_x);
    copy(rays.origin_y, packet.org_y);
    copy(rays.origin_z, packet.org_z);
    copy(rays.direction_x, packet.dir_x);
    copy(rays.direction_y, packet.dir_y);
    copy(rays.direction_z, packet.dir_z);
    copy(rays.t_max, packet.tfar);
    std::fill_n(packet.tnear, packet_width, 0.0F);
    std::fill_n(packet.time, packet_width, 0.0F);
    std::fill_n(packet.mask, packet_width, ~0U);
    std::fill_n(packet.id, packet_width, 0U);
    std::fill_n(packet.flags, packet_width, 0U);
    for (size_t i = 0; i < packet_width; ++i) valid[i] = first + i < rays.count ? -1 : 0;
}

}  // namespace

void Accelerator::intersect(RayBatch& rays, bool coherent, HitBatch& hits) const {
    // Among instances as for occlusion below, which coherent packets seem to escape here.
    const bool as_coherent = coherent || implementation_->has_instances;
    embree::Context context(as_coherent ? embree::Coherence::coherent : embree::Coherence::incoherent);
    alignas(64) RTCRayHit16 packet;
    alignas(64) int valid[packet_width];
    for (size_t first = 0; first < rays.count; first += packet_width) {
        load_packet(rays, first, packet.ray, valid);
        std::fill_n(packet.hit.geomID, packet_width, RTC_INVALID_GEOMETRY_ID);
        std::fill_n(packet.hit.instID[0], packet_width, RTC_INVALID_GEOMETRY_ID);
        embree::intersect16(valid, implementation_->top, context, packet);
        std::copy_n(packet.hit.u, packet_width, hits.u.data() + first);
        std::copy_n(packet.hit.v, packet_width, hits.v.data() + first);
        std::copy_n(packet.ray.tfar, packet_width, hits.t.data() + first);
        for (size_t i = 0; i < packet_width; ++i) {
            uint32_t object = no_hit;
            uint32_t primitive = packet.hit.primID[i];
            if (packet.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID) {
                implementation_->translate(packet.hit.geomID[i], packet.hit.instID[0][i], object, primitive);
            }
            hits.object[first + i] = object;
            hits.primitive[first + i] = primitive;
        }
    }
}

void Accelerator::occluded(RayBatch& rays, bool coherent, AlignedArray<uint32_t>& occluded) const {
    // Embree 3.13's occlusion packets never return from some scenes with instances (seen with 16-wide packets, robust
    // or not, marked coherent or not; single rays are fine). Only speed is lost.
    if (implementation_->has_instances) {
        for (size_t i = 0; i < rays.count; ++i) {
            occluded[i] = this->occluded({rays.origin(i), rays.direction(i), rays.t_max[i]}) ? 1U : 0U;
        }
        return;
    }
    embree::Context context(coherent ? embree::Coherence::coherent : embree::Coherence::incoherent);
    alignas(64) RTCRay16 packet;
    alignas(64) int valid[packet_width];
    for (size_t first = 0; first < rays.count; first += packet_width) {
        load_packet(rays, first, packet, valid);
        embree::occluded16(valid, implementation_->top, context, packet);
        for (size_t i = 0; i < packet_width; ++i) occluded[first + i] = packet.tfar[i] < 0.0F ? 1U : 0U;
    }
}

}  // namespace nephroid
