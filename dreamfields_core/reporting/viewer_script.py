"""The viewer's program: a small WebGL 2 renderer for the one mesh that the page carries as binary glTF, and the hand that turns it.

It asks for nothing: the bytes are in the page. Colours are made linear before light falls on them, and display values again after.
"""

SHADERS = """
const VERTEX = `#version 300 es
uniform mat4 view;
in vec3 position, normal; in vec2 uv; in vec4 tangent, color;
out vec3 n, t, p; out vec2 at; out vec3 paint; out float hand;
void main() {
  gl_Position = view * vec4(position, 1.0);
  p = position; n = normal; t = tangent.xyz; hand = tangent.w; at = uv; paint = color.rgb;
}`;
const FRAGMENT = `#version 300 es
precision highp float;
uniform sampler2D picture, bumps;
uniform bool pictured, bumped; uniform int mode; uniform vec3 eye;
in vec3 n, t, p; in vec2 at; in vec3 paint; in float hand;
out vec4 shown;
vec3 display(vec3 c) {
  return mix(12.92 * c, 1.055 * pow(max(c, 0.0031308), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}
void main() {
  vec3 facing = normalize(n), base = pictured ? texture(picture, at).rgb : paint;
  if (bumped && length(t) > 0.0) {
    vec3 lean = 2.0 * texture(bumps, at).rgb - 1.0;
    facing = normalize(lean.x * t + lean.y * hand * cross(facing, t) + lean.z * facing);
  }
  if (mode == 2) base = vec3(0.5);
  vec3 toward = normalize(eye - p), lamp = normalize(toward + vec3(0.0, 0.8, 0.0) + 0.5 * cross(vec3(0.0, 1.0, 0.0), toward));
  float sky = 0.5 + 0.5 * facing.y, key = max(dot(facing, lamp), 0.0);
  vec3 light = mode == 1 ? vec3(1.0) : vec3(mix(0.22, 0.42, sky) + 0.58 * key);
  shown = vec4(display(min(base * light, 1.0)), 1.0);
}`;
"""

GLTF = """
// Binary glTF 2.0: a header of 12 bytes, then chunks of (length, kind, bytes): the tree, the buffer.
const bytes = Uint8Array.from(atob(document.getElementById("glb").textContent), (c) => c.charCodeAt(0));
const words = new DataView(bytes.buffer), treeSize = words.getUint32(12, true);
const tree = JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + treeSize)));
const part = (view) => bytes.subarray(28 + treeSize + (view.byteOffset || 0)).subarray(0, view.byteLength);
const KINDS = { 5121: Uint8Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };
const WIDTHS = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };
const numbers = (index) => {
  const accessor = tree.accessors[index], width = WIDTHS[accessor.type], data = part(tree.bufferViews[accessor.bufferView]).slice();
  return { width, type: accessor.componentType, values: new KINDS[accessor.componentType](data.buffer, 0, accessor.count * width) };
};
const primitive = tree.meshes[0].primitives[0], material = tree.materials[primitive.material];
const box = tree.accessors[primitive.attributes.POSITION];
// As a data address: a picture from a blob would taint the canvas of a page that was opened from a folder.
const imageOf = (texture) => new Promise((done, failed) => {
  const source = tree.images[tree.textures[texture.index].source], data = part(tree.bufferViews[source.bufferView]);
  let text = "";
  for (let begin = 0; begin < data.length; begin += 32768) text += String.fromCharCode(...data.subarray(begin, begin + 32768));
  const image = new Image();
  image.onload = () => done(image);
  image.onerror = () => failed(new Error("the texture cannot be read"));
  image.src = `data:${source.mimeType};base64,${btoa(text)}`;
});
"""

RENDERER = """
const canvas = document.getElementById("object");
const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true });
if (!gl) throw new Error("no WebGL 2");

const program = gl.createProgram();
for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
  const shader = gl.createShader(kind);
  gl.shaderSource(shader, source);
  gl.compileShader(shader);
  if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
  gl.attachShader(program, shader);
}
gl.linkProgram(program);
if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
gl.useProgram(program);
const place = (name) => gl.getUniformLocation(program, name);

gl.vertexAttrib3f(gl.getAttribLocation(program, "color"), 0.6, 0.6, 0.6);  // of a mesh that says nothing of its colour
const NAMES = { POSITION: "position", NORMAL: "normal", TEXCOORD_0: "uv", TANGENT: "tangent", COLOR_0: "color" };
for (const [name, index] of Object.entries(primitive.attributes)) {
  const where = gl.getAttribLocation(program, NAMES[name]);
  if (where < 0) continue;
  const { width, type, values } = numbers(index);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
  gl.enableVertexAttribArray(where);
  gl.vertexAttribPointer(where, width, type, false, 0, 0);
}
const corners = numbers(primitive.indices);
gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners.values, gl.STATIC_DRAW);

const upload = async (texture, unit, name, format) => {
  gl.uniform1i(place(name), unit);
  if (!texture) return false;
  const image = await imageOf(texture);
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
  gl.texImage2D(gl.TEXTURE_2D, 0, format, gl.RGBA, gl.UNSIGNED_BYTE, image);
  gl.generateMipmap(gl.TEXTURE_2D);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  return true;
};
gl.enable(gl.DEPTH_TEST);
gl.enable(gl.CULL_FACE);

const middle = box.min.map((low, axis) => (low + box.max[axis]) / 2);
const reach = Math.hypot(...box.min.map((low, axis) => box.max[axis] - low)) / 2 || 1;
const camera = { turn: 0.6, rise: 0.35, distance: 2.8, mode: 0 };

// Column-major: a perspective of 36 degrees times a look from the eye at the middle.
const draw = () => {
  const scale = Math.min(window.devicePixelRatio || 1, 2);
  const width = Math.max(1, Math.round(canvas.clientWidth * scale)), height = Math.max(1, Math.round(canvas.clientHeight * scale));
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  gl.viewport(0, 0, width, height);
  const [st, ct, sr, cr] = [Math.sin(camera.turn), Math.cos(camera.turn), Math.sin(camera.rise), Math.cos(camera.rise)];
  const back = [st * cr, sr, ct * cr], right = [ct, 0, -st], up = [-st * sr, cr, -ct * sr];
  const eye = back.map((value, axis) => middle[axis] + value * camera.distance * reach);
  const dot = (a) => -(a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2]);
  const zoom = Math.min(width, height) / Math.tan(Math.PI / 10);  // the shorter side shows 36 degrees
  const near = Math.max(0.01, camera.distance - 1.2) * reach, far = (camera.distance + 1.2) * reach;
  const a = (far + near) / (near - far), b = 2 * far * near / (near - far);
  const x = zoom / width, y = zoom / height;
  const column = (axis) => [x * right[axis], y * up[axis], a * back[axis], -back[axis]];
  const view = [...column(0), ...column(1), ...column(2), x * dot(right), y * dot(up), a * dot(back) + b, -dot(back)];
  gl.uniformMatrix4fv(place("view"), false, view);
  gl.uniform3fv(place("eye"), eye);
  gl.uniform1i(place("mode"), camera.mode);
  gl.clearColor(0, 0, 0, 0);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.drawElements(gl.TRIANGLES, corners.values.length, corners.type, 0);
};
"""

CONTROLS = """
let waiting = false, turning = !matchMedia("(prefers-reduced-motion: reduce)").matches, last = 0;
const redraw = () => { if (!waiting) { waiting = true; requestAnimationFrame(frame); } };
const frame = (now) => {
  waiting = false;
  if (turning) { camera.turn += Math.min(now - last, 100) * 0.0004; redraw(); }
  last = now;
  draw();
};
const move = (turn, rise) => {
  turning = false;
  camera.turn -= turn;
  camera.rise = Math.max(-1.5, Math.min(1.5, camera.rise + rise));
  redraw();
};
const zoomBy = (factor) => { turning = false; camera.distance = Math.max(0.3, Math.min(20, camera.distance * factor)); redraw(); };
const reset = () => { Object.assign(camera, { turn: 0.6, rise: 0.35, distance: 2.8 }); turning = false; redraw(); };

const fingers = new Map();
const spread = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, { x: event.x, y: event.y });
});
canvas.addEventListener("pointermove", (event) => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  const apart = fingers.size === 2 ? spread() : 0;
  fingers.set(event.pointerId, { x: event.x, y: event.y });
  if (apart) zoomBy(apart / Math.max(1, spread()));
  else move((event.x - before.x) * 0.008, (event.y - before.y) * 0.008);
});
for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoomBy(Math.exp(event.deltaY * 0.001)); }, { passive: false });
canvas.addEventListener("dblclick", reset);
const KEYS = {
  ArrowLeft: () => move(-0.1, 0), ArrowRight: () => move(0.1, 0), ArrowUp: () => move(0, 0.1), ArrowDown: () => move(0, -0.1),
  "+": () => zoomBy(0.9), "-": () => zoomBy(1.1), "0": reset,
};
canvas.addEventListener("keydown", (event) => { if (KEYS[event.key]) { event.preventDefault(); KEYS[event.key](); } });
for (const button of document.querySelectorAll("button[data-mode]")) button.addEventListener("click", () => {
  camera.mode = Number(button.dataset.mode);
  for (const other of document.querySelectorAll("button[data-mode]")) other.setAttribute("aria-pressed", String(other === button));
  redraw();
});
document.getElementById("reset").addEventListener("click", reset);
window.addEventListener("resize", redraw);
"""

SCRIPT = f"""
"use strict";
(async () => {{
  const stage = document.getElementById("stage");
  try {{
{SHADERS}{GLTF}{RENDERER}
    gl.uniform1i(place("pictured"), await upload(material.pbrMetallicRoughness.baseColorTexture, 0, "picture", gl.SRGB8_ALPHA8));
    gl.uniform1i(place("bumped"), await upload(material.normalTexture, 1, "bumps", gl.RGBA8));
{CONTROLS}
    draw();
    redraw();
    stage.className = "live";
  }} catch (error) {{
    document.getElementById("why").textContent = String(error.message || error);
    stage.className = "still";
  }}
}})();
"""
