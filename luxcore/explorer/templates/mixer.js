// WebGL 2: one texture array holds every layer, one fragment shader mixes them.
class Mixer {
  constructor(canvas, scene, layerImages, photoImage) {
    canvas.width = scene.width;
    canvas.height = scene.height;
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false });
    if (!gl) throw new Error("webgl2");
    this.gl = gl;
    this.scene = scene;
    this.program = Mixer.build(gl, document.getElementById("fragment").textContent.trim());
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
    this.uploadLayers(layerImages);
    this.uploadPhoto(photoImage);
    gl.useProgram(this.program);
    gl.uniform1i(this.at("layers"), 0);
    gl.uniform1i(this.at("photo"), 1);
    gl.uniform1fv(this.at("spans"), scene.rows.map((row) => row.span));
    gl.uniform1i(this.at("flip"), 1);
  }

  static build(gl, fragment) {
    const vertex = `#version 300 es
      void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0, 1); }`;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      const logs = gl.getAttachedShaders(program).map((shader) => gl.getShaderInfoLog(shader));
      throw new Error(gl.getProgramInfoLog(program) + logs.join(""));
    }
    return program;
  }

  at(name) { return this.gl.getUniformLocation(this.program, name); }

  bind(unit, target) {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(target, gl.createTexture());
    gl.texParameteri(target, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(target, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  }

  uploadLayers(images) {
    const gl = this.gl, { width, height } = this.scene;
    this.bind(0, gl.TEXTURE_2D_ARRAY);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA8, width, height, images.length);
    images.forEach((image, i) => gl.texSubImage3D(
      gl.TEXTURE_2D_ARRAY, 0, 0, 0, i, width, height, 1, gl.RGBA, gl.UNSIGNED_BYTE, image));
  }

  uploadPhoto(image) {
    const gl = this.gl;
    this.bind(1, gl.TEXTURE_2D);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, image);
  }

  // split is the percentage of the width, from the left, that shows the photo as taken.
  draw(weights, ev, split) {
    const gl = this.gl, { width, height } = this.scene;
    gl.viewport(0, 0, width, height);
    gl.uniform3fv(this.at("weights"), weights.flat());
    gl.uniform1f(this.at("gain"), 2 ** ev);
    gl.uniform1f(this.at("split_px"), (split / 100) * width);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}

async function decodePicture(base64) {
  const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  return createImageBitmap(new Blob([bytes], { type: "image/webp" }), {
    colorSpaceConversion: "none", premultiplyAlpha: "none",
  });
}
