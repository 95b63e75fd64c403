#include <gtest/gtest.h>

#include <cstdlib>
#include <future>
#include <memory>

#include "core/base/error.h"
#include "core/gpu/objects.h"
#include "core/gpu/program.h"
#include "core/gpu/source.h"
#include "core/gpu/thread.h"
#include "tests/support/volumes.h"

using namespace voxloom;

TEST(OpenGLThread, RunsThereAndBringsExceptionsBack) {
    EXPECT_FALSE(gpu::on_thread());
    gpu::run([] {
        EXPECT_TRUE(gpu::on_thread());
        gpu::run([] { EXPECT_TRUE(gpu::on_thread()); });  // at once, without waiting for itself
    });
    EXPECT_THROW(gpu::run([] { fail("no"); }), Error);
    EXPECT_EQ(gpu::why_unavailable(), "");
    EXPECT_GE(gpu::context_info().max_texture_3d, 256);
}

TEST(OpenGLThread, PostedWorkRunsInOrder) {
    std::promise<int> done;
    int value = 0;
    gpu::post([&] { value = 1; });
    gpu::post([&] { done.set_value(value + 1); });
    EXPECT_EQ(done.get_future().get(), 2);
}

TEST(OpenGLThread, WithoutOpenGLItSaysSo) {
    // In a process of its own, since the context is made once.
    ::testing::FLAGS_gtest_death_test_style = "threadsafe";
    EXPECT_EXIT(
        {
            setenv("VOXLOOM_NO_OPENGL", "1", 1);
            std::string reason = gpu::why_unavailable();
            bool thrown = false;
            try {
                gpu::run([] {});
            } catch (const Error& e) {
                thrown = reason == e.what();
            }
            std::exit(thrown && reason.find("OpenGL: ") == 0 ? 7 : 1);
        },
        ::testing::ExitedWithCode(7), "");
}

TEST(GpuObjects, AreReleasedOnTheirThreadWhereverTheyDie) {
    auto texture = std::make_shared<gpu::Texture>();
    GLuint name = 0;
    gpu::run([&] {
        *texture = gpu::make_texture(GL_TEXTURE_2D, GL_R32F, {4, 4, 1}, GL_NEAREST, "a test");
        name = texture->name();
        EXPECT_TRUE(glIsTexture(name));
    });
    texture.reset();  // here, on another thread
    gpu::run([&] { EXPECT_FALSE(glIsTexture(name)); });
}

TEST(GpuObjects, ATextureBeyondTheLimitIsAnErrorThatNamesIt) {
    gpu::run([] {
        try {
            gpu::make_texture(GL_TEXTURE_3D, GL_R8, {1 << 20, 1, 1}, GL_NEAREST, "the moon");
            ADD_FAILURE() << "was made";
        } catch (const Error& e) {
            EXPECT_NE(std::string(e.what()).find("the moon"), std::string::npos);
        }
    });
}

TEST(Programs, ErrorsNameTheModuleAndItsLine) {
    gpu::run([] {
        try {
            gpu::program({{"triangle", "void main() { gl_Position = vec4(0.0); }"}},
                         {{"fine", "float half_of(float x) { return 0.5 * x; }"},
                          {"broken", "out vec4 c;\nvoid main() { c = vec4(nonsense); }"}});
            ADD_FAILURE() << "it compiled";
        } catch (const Error& e) {
            EXPECT_NE(std::string(e.what()).find("broken:2"), std::string::npos) << e.what();
        }
    });
}

TEST(Programs, TheSameModulesGiveTheSameProgram) {
    gpu::run([] {
        std::vector<gpu::Module> vertex = {{"v", "void main() { gl_Position = vec4(0.0); }"}};
        std::vector<gpu::Module> fragment = {{"f", "out vec4 c; void main() { c = vec4(1.0); }"}};
        EXPECT_EQ(gpu::program(vertex, fragment), gpu::program(vertex, fragment));
    });
}

TEST(DenseSource, EveryIntegerOfSixteenBitsHasATexelOfItsOwn) {
    gpu::run([] {
        VolumePtr volume = voxloom::testing::make_volume({256, 256, 1}, ScalarType::i16, [](auto x, auto y, auto) {
            return double(y * 256 + x) - 32768;
        });
        std::uint64_t bytes = 0;
        gpu::VoxelSource source = gpu::upload_dense(*volume, 0, {}, bytes);
        EXPECT_EQ(bytes, 256u * 256 * 2);
        std::vector<std::uint16_t> texels(256 * 256);
        glGetTextureImage(source.textures[0].texture->name(), 0, GL_RED, GL_UNSIGNED_SHORT,
                          GLsizei(texels.size() * 2), texels.data());
        for (std::size_t i = 0; i < texels.size(); ++i)
            ASSERT_EQ(std::lround(source.offset + source.scale * texels[i] / 65535.0), long(i) - 32768);
    });
}

TEST(SourceProviders, AnswerForWhatTheyKnow) {
    gpu::register_source_provider("test", [](const Value& v, const gpu::SourceRequest&) {
        std::optional<gpu::FieldSource> out;
        if (std::holds_alternative<CameraPtr>(v)) {
            out.emplace();
            out->own_kernels = true;
        }
        return out;
    });
    EXPECT_FALSE(gpu::provided_source(Value(), {}));
    auto source = gpu::provided_source(CameraPtr(std::make_shared<Camera>()), {});
    ASSERT_TRUE(source);
    EXPECT_TRUE(source->own_kernels);
}
