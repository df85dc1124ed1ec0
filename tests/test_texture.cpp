// sample_texture and picture files.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/image_io.h"
#include "core/texture.h"
#include "tests/gltf_builder.h"

using namespace nephroid;
using namespace nephroid::test;

namespace {

/// 4 x 1 picture whose red values are 0, 51, 102, 255.
Image ramp() {
    Image image;
    image.width = 4;
    image.height = 1;
    image.channels = 1;
    image.bytes = {0, 51, 102, 255};
    return image;
}

float sample_ramp(WrapMode wrap, float u, bool nearest = false) {
    TextureReference reference;
    reference.image = 0;
    reference.wrap_u = wrap;
    reference.nearest = nearest;
    return sample_texture(ramp(), reference, {u, 0.5F}).r;
}

float expected_linear(float encoded) {
    return encoded <= 0.04045F ? encoded / 12.92F : std::pow((encoded + 0.055F) / 1.055F, 2.4F);
}

}  // namespace

TEST_CASE("bilinear sampling hits texel centres and interpolates between them") {
    CHECK(sample_ramp(WrapMode::clamp_to_edge, 0.375F) == doctest::Approx(0.2F));
    CHECK(sample_ramp(WrapMode::clamp_to_edge, 0.5F) == doctest::Approx(0.3F));
    CHECK(sample_ramp(WrapMode::clamp_to_edge, 0.4375F) == doctest::Approx(0.25F));
}

TEST_CASE("wrap modes") {
    SUBCASE("repeat interpolates across the seam") {
        CHECK(sample_ramp(WrapMode::repeat, 0.0F) == doctest::Approx(0.5F));
        CHECK(sample_ramp(WrapMode::repeat, 1.0F) == doctest::Approx(0.5F));
        CHECK(sample_ramp(WrapMode::repeat, -0.625F) == doctest::Approx(0.2F));
        CHECK(sample_ramp(WrapMode::repeat, 7.375F) == doctest::Approx(0.2F));
    }
    SUBCASE("mirrored repeat") {
        CHECK(sample_ramp(WrapMode::mirrored_repeat, -0.375F) == doctest::Approx(0.2F));
        CHECK(sample_ramp(WrapMode::mirrored_repeat, 1.625F) == doctest::Approx(0.2F));
        CHECK(sample_ramp(WrapMode::mirrored_repeat, 2.375F) == doctest::Approx(0.2F));
        CHECK(sample_ramp(WrapMode::mirrored_repeat, 0.0F) == doctest::Approx(0.0F));
        CHECK(sample_ramp(WrapMode::mirrored_repeat, 1.0F) == doctest::Approx(1.0F));
    }
    SUBCASE("clamp to edge") {
        CHECK(sample_ramp(WrapMode::clamp_to_edge, -5.0F) == 0.0F);
        CHECK(sample_ramp(WrapMode::clamp_to_edge, 5.0F) == 1.0F);
    }
}

TEST_CASE("nearest sampling") {
    CHECK(sample_ramp(WrapMode::repeat, 0.26F, true) == doctest::Approx(0.2F));
    CHECK(sample_ramp(WrapMode::repeat, 0.49F, true) == doctest::Approx(0.2F));
    CHECK(sample_ramp(WrapMode::clamp_to_edge, 1.0F, true) == 1.0F);
    CHECK(sample_ramp(WrapMode::mirrored_repeat, 1.01F, true) == 1.0F);
}

TEST_CASE("texture coordinates that are huge or not finite give a value of the picture") {
    for (const WrapMode wrap : {WrapMode::repeat, WrapMode::mirrored_repeat, WrapMode::clamp_to_edge}) {
        for (const float u : {1e30F, -1e30F, 3e6F, -1e-30F, std::numeric_limits<float>::infinity(),
                              -std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
            for (const bool nearest : {false, true}) {
                const float value = sample_ramp(wrap, u, nearest);
                CHECK(value >= 0.0F);
                CHECK(value <= 1.0F);
            }
        }
    }
}

TEST_CASE("sRGB applies to colour but not to alpha") {
    Image image;
    image.width = 1;
    image.height = 1;
    image.channels = 4;
    image.bytes = {128, 5, 255, 128};
    TextureReference reference;
    reference.srgb = true;
    const Vec4 value = sample_texture(image, reference, {0.3F, 0.7F});
    CHECK(value.r == doctest::Approx(expected_linear(128.0F / 255.0F)));
    CHECK(value.g == doctest::Approx(expected_linear(5.0F / 255.0F)));
    CHECK(value.b == doctest::Approx(1.0F));
    CHECK(value.a == doctest::Approx(128.0F / 255.0F));
}

TEST_CASE("missing channels are 0 and missing alpha is 1") {
    for (int channels = 1; channels <= 4; ++channels) {
        Image image;
        image.width = 1;
        image.height = 1;
        image.channels = channels;
        image.storage = Image::Storage::float32;
        image.floats.assign(static_cast<size_t>(channels), 0.5F);
        const Vec4 value = sample_texture(image, {}, {0.5F, 0.5F});
        for (int c = 0; c < 4; ++c) CHECK(value[c] == (c < channels ? 0.5F : c == 3 ? 1.0F : 0.0F));
    }
}

TEST_CASE("the texture transform comes before wrapping; row 0 is at v = 0") {
    Image image;
    image.width = 1;
    image.height = 2;
    image.channels = 1;
    image.bytes = {255, 0};
    TextureReference reference;
    reference.nearest = true;
    CHECK(sample_texture(image, reference, {0.5F, 0.25F}).r == 1.0F);
    CHECK(sample_texture(image, reference, {0.5F, 0.75F}).r == 0.0F);
    reference.uv_offset = {0.0F, 0.5F};
    CHECK(sample_texture(image, reference, {0.5F, 0.75F}).r == 1.0F);
    reference.uv_matrix = glm::mat2(0.0F, 1.0F, 1.0F, 0.0F);  // Swaps u and v.
    reference.uv_offset = Vec2(0.0F);
    CHECK(sample_texture(image, reference, {0.25F, 0.75F}).r == 1.0F);
}

TEST_CASE("pictures are decoded as they are stored") {
    const std::vector<float> values = {1.0F, 0.0F, 0.0F, 0.5F, 0.0F, 1.0F, 0.2F, 0.0F};
    SUBCASE("8-bit PNG with unassociated alpha") {
        const Image image = decode_image(encode_picture("png", 2, 1, 4, values), "test");
        CHECK(image.width == 2);
        CHECK(image.height == 1);
        CHECK(image.channels == 4);
        CHECK(image.storage == Image::Storage::uint8);
        CHECK(image.bytes == std::vector<uint8_t>{255, 0, 0, 128, 0, 255, 51, 0});
    }
    SUBCASE("16-bit PNG becomes float") {
        const Image image = decode_image(encode_picture("png", 2, 1, 4, values, true), "test");
        CHECK(image.storage == Image::Storage::float32);
        CHECK(image.floats[0] == 1.0F);
        CHECK(image.floats[3] == doctest::Approx(0.5F).epsilon(1e-4));
    }
    SUBCASE("EXR") {
        const Image image = decode_image(encode_picture("exr", 2, 1, 4, values), "test");
        CHECK(image.floats == values);
    }
    SUBCASE("Radiance HDR") {
        const Image image = decode_image(encode_picture("hdr", 1, 2, 3, {8.0F, 4.0F, 2.0F, 1.0F, 1.0F, 1.0F}), "test");
        CHECK(image.channels == 3);
        CHECK(image.floats[0] == doctest::Approx(8.0F).epsilon(0.02));
    }
    SUBCASE("JPEG") {
        const Image image = decode_image(encode_picture("jpeg", 8, 8, 3, std::vector<float>(192, 0.5F)), "test");
        CHECK(image.storage == Image::Storage::uint8);
        CHECK(std::abs(int{image.bytes[0]} - 128) < 4);
    }
}

TEST_CASE("unreadable pictures are refused by name") {
    const auto error_of = [](const Bytes& bytes) -> std::string {
        try {
            decode_image(bytes, "some picture");
        } catch (const Error& error) {
            CHECK(error.code() == ExitCode::invalid_input);
            return error.what();
        }
        return {};
    };
    CHECK(error_of({}).find("some picture: ") == 0);
    CHECK(error_of({'G', 'I', 'F', '8'}).find("some picture: ") == 0);
    Bytes png = encode_picture("png", 2, 2, 3, std::vector<float>(12, 0.5F));
    Bytes truncated(png.begin(), png.begin() + 50);
    CHECK(error_of(truncated).find("some picture: ") == 0);
    png[16] = 0x7F;  // The width becomes 2^31 or so.
    CHECK(error_of(png).find("too large") != std::string::npos);
    CHECK_THROWS_AS(read_image("/nonexistent/picture.png"), Error);
    CHECK_THROWS_AS(read_image("/tmp"), Error);
}
