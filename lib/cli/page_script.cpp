// Style and scripts of the pages.
#include "cli/page_script.hpp"

namespace dpr::cli {

std::string_view page_style() {
  return R"(<style>
:root { color-scheme: light dark; --text: #222; --page: #fff; --quiet: #555; --line: #ddd; --frame: #bbb;
  --camera: #777; --other: #d22; }
@media (prefers-color-scheme: dark) {
  :root { --text: #ddd; --page: #181818; --quiet: #aaa; --line: #444; --frame: #666;
    --camera: #999; --other: #f66; }
}
body { font-family: system-ui, sans-serif; line-height: 1.4; max-width: 62rem; margin: 1.5rem auto; padding: 0 1rem;
  color: var(--text); background: var(--page); }
h1 { line-height: 1.15; margin-bottom: 0.3em; }
h2 { margin-top: 1.8em; }
.source { color: var(--quiet); font-size: 90%; overflow-wrap: anywhere; }
figure { margin: 0; min-width: 0; }
figure img { display: block; width: 100%; object-fit: cover; box-sizing: border-box; border: 1px solid var(--frame); }
img.pixels { image-rendering: pixelated; }
figcaption { font-size: 85%; color: var(--quiet); padding-top: 0.2em; }
.pictures, .stage, .row { display: grid; gap: 0.8rem; align-items: start; }
.pictures, .stage { grid-template-columns: repeat(auto-fit, minmax(min(100%, 9.5rem), 1fr)); }
.stage { max-width: calc(20rem * var(--stage)); }
.rows { display: grid; gap: 0.8rem; margin-top: 0.6rem;
  grid-template-columns: repeat(auto-fill, minmax(min(100%, calc(6.5rem * var(--row))), 1fr)); }
.row { grid-template-columns: repeat(var(--row), minmax(0, 1fr)); gap: 0.3rem; }
.controls { display: flex; gap: 0.8rem; align-items: center; max-width: 40rem; margin: 0.6rem 0; }
.controls input { flex: 1; min-width: 0; height: 2rem; margin: 0; }
.controls button { font: inherit; padding: 0.4em 1em; min-width: 5.5em; }
.wipe { max-width: 25rem; margin-top: 1.2rem; }
.wipe .pictures { display: block; position: relative; }
.wipe figure + figure { position: absolute; inset: 0; }
.wipe figcaption { display: none; }
.plot { width: 100%; }
[hidden] { display: none; }
.curves .picture { position: relative; }
.curves img { display: block; width: 100%; }
.curves .place { position: absolute; top: 0; bottom: 0; border-left: 2px solid #d22; pointer-events: none; }
.curves .values { position: sticky; bottom: 0; margin: 0; padding: 0.3em 0; min-height: 2.8em; font-size: 90%;
  font-variant-numeric: tabular-nums; background: var(--page); }
.model { max-width: 40rem; }
.model .view { position: relative; overflow: hidden; max-height: 80vh; border: 1px solid var(--frame); }
.model canvas { position: absolute; inset: 0; width: 100%; height: 100%; touch-action: none; cursor: grab; }
.model canvas:focus-visible { outline: 2px solid var(--camera); outline-offset: -2px; }
.model .view span { position: absolute; pointer-events: none; font-size: 75%; line-height: 1; padding: 0.15em;
  white-space: nowrap; color: var(--text); }
.model .view .other { color: var(--other); }
.model .view .near { background: var(--page); z-index: 1; }
.model .view .near.right { translate: -100% 0; }
.model .view.many span:not(.near, .other) { display: none; }
.model button { font: inherit; padding: 0.4em 1em; margin-top: 0.4em; }
table { border-collapse: collapse; margin: 1em 0; }
td, th { min-width: 3.5em; padding: 0.2em 1em 0.2em 0; text-align: left; vertical-align: top; border-bottom: 1px solid var(--line);
  font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
.wide { overflow-x: auto; margin: 1em 0; }
.wide table { margin: 0; }
.wide td { white-space: nowrap; }
th { font-weight: normal; color: var(--quiet); overflow-wrap: normal; }
</style>
)";
}

// The second picture of a wipe lies over the first, up to where the slider is. A row of the player's list is copied
// into its stage, and shown again whenever the slider moves. The values of curves are those nearest to the pointer.
std::string_view page_script() {
  return R"js(<script>
for (const wipe of document.querySelectorAll('.wipe')) {
  const over = wipe.querySelector('figure + figure'), slider = wipe.querySelector('input');
  slider.oninput = () => { over.style.clipPath = 'inset(0 ' + (100 - slider.value) + '% 0 0)'; };
  slider.oninput();
  wipe.hidden = false;
}
for (const player of document.querySelectorAll('.player')) {
  const rows = [...player.querySelectorAll('.row')];
  const stage = player.querySelector('.stage'), controls = player.querySelector('.controls');
  const button = controls.querySelector('button'), slider = controls.querySelector('input');
  const screens = [...rows[0].children].map(figure => stage.appendChild(figure.cloneNode(true)));
  const show = () => {
    const figures = [...rows[slider.value].children];
    const caption = figure => figure.querySelector('figcaption').textContent;
    slider.ariaValueText = figures.map(caption).join(', ');
    screens.forEach((screen, i) => {
      const [to, from] = [screen, figures[i]].map(f => f.querySelector('img'));
      if (to.src !== from.src) to.src = from.src;
      to.style.cssText = from.style.cssText;
      to.alt = from.alt;
      screen.querySelector('figcaption').textContent = caption(figures[i]);
    });
  };
  let timer = 0;
  const stop = () => { clearInterval(timer); timer = 0; button.textContent = 'Play'; };
  const step = () => { slider.value = (Number(slider.value) + 1) % rows.length; show(); };
  button.onclick = () => {
    if (timer) return stop();
    timer = setInterval(step, 400);
    button.textContent = 'Pause';
    step();
  };
  slider.oninput = () => { stop(); show(); };
  show();
  stage.hidden = controls.hidden = false;
  player.querySelector('details').open = false;
}
for (const curves of document.querySelectorAll('.curves')) {
  const data = JSON.parse(curves.querySelector('script').textContent), picture = curves.querySelector('img');
  const place = curves.querySelector('.place'), values = curves.querySelector('.values');
  const low = data.x.reduce((a, b) => Math.min(a, b)), high = data.x.reduce((a, b) => Math.max(a, b));
  let index = 0;
  const show = chosen => {
    index = Math.min(Math.max(chosen, 0), data.x.length - 1);
    const part = (data.x[index] - low) / (high - low);
    place.style.left = 100 * (data.left + part * (data.right - data.left)) + '%';
    const read = curve => curve.name + ' ' + (curve.y[index] ?? 'none');
    values.textContent = [data.name + ' ' + data.x[index], ...data.curves.map(read)].join(', ');
    place.hidden = values.hidden = false;
  };
  const point = event => {
    const box = picture.getBoundingClientRect();
    const part = ((event.clientX - box.left) / box.width - data.left) / (data.right - data.left);
    const x = low + part * (high - low), distance = i => Math.abs(data.x[i] - x);
    let nearest = 0;
    data.x.forEach((_, i) => { if (distance(i) < distance(nearest)) nearest = i; });
    show(nearest);
  };
  const pointed = curves.querySelector('.picture');
  pointed.onpointermove = pointed.onpointerdown = point;
  pointed.onfocus = () => show(index);
  pointed.onkeydown = event => {
    const steps = {ArrowLeft: -1, ArrowRight: 1, Home: -data.x.length, End: data.x.length};
    if (!(event.key in steps)) return;
    event.preventDefault();
    show(index + steps[event.key]);
  };
  pointed.tabIndex = 0;
  values.hidden = false;
}
</script>
)js";
}

// A model is drawn when something changes, and at no other time. Turns are about the pivot: what lies there keeps its
// place in the picture, also where the first view does not look at it.
std::string_view model_script() {
  return R"js(<script>
for (const model of document.querySelectorAll('.model')) {
  model.hidden = false;
  const view = model.querySelector('.view'), canvas = view.querySelector('canvas');
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({canvas, alpha: true, antialias: true});
  } catch (error) {
    model.querySelector('figure').hidden = true;
    model.querySelector('.without').hidden = false;
    continue;
  }
  const data = JSON.parse(model.querySelector('script').textContent);
  const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0));
  const vector = numbers => new THREE.Vector3(...numbers);
  const scene = new THREE.Scene(), eye = new THREE.PerspectiveCamera();
  const pivot = vector(data.pivot), up = vector(data.up);
  const start = new THREE.Matrix4().fromArray(data.start.matrix);
  const farthest = 20 * new THREE.Vector3().setFromMatrixPosition(start).distanceTo(pivot);

  const positions = new Float32Array(bytes(data.positions).buffer);
  const mesh = new THREE.BufferGeometry();
  mesh.setAttribute('position', new THREE.BufferAttribute(positions, 3));
  mesh.setAttribute('color', new THREE.BufferAttribute(bytes(data.colors), 3, true));
  mesh.setIndex(new THREE.BufferAttribute(new Uint32Array(bytes(data.faces).buffer), 1));
  mesh.setAttribute('normal', new THREE.BufferAttribute(new Int8Array(bytes(data.normals).buffer), 3, true));
  if (data.texcoords) {
    mesh.setAttribute('uv', new THREE.BufferAttribute(new Float32Array(bytes(data.texcoords).buffer), 2));
  }
  const loaded = address => {
    const image = new Image(), texture = new THREE.Texture(image);
    image.onload = () => { texture.needsUpdate = true; draw(); };
    image.src = address;
    return texture;
  };
  const surface = map => new THREE.MeshLambertMaterial({map, vertexColors: THREE.VertexColors,
    side: THREE.DoubleSide});
  let first = 0;
  const surfaces = data.textures.map((part, i) => {
    mesh.addGroup(first, 3 * part.faces, i);
    first += 3 * part.faces;
    const texture = loaded(part.picture);
    texture.wrapS = texture.wrapT = THREE[part.wrap + 'Wrapping'];
    return surface(texture);
  });
  mesh.addGroup(first, mesh.index.count - first, surfaces.length);
  scene.add(new THREE.Mesh(mesh, surfaces.concat(surface(null))));
  const light = new THREE.DirectionalLight(0xffffff, 0.4);
  light.target.position.copy(pivot);
  scene.add(new THREE.AmbientLight(0xffffff, 0.65), light, light.target);

  let reach = 0;
  const include = point => { reach = Math.max(reach, point.distanceTo(pivot)); };
  for (let i = 0; i < positions.length; i += 3) include(vector(positions.subarray(i, i + 3)));
  const cameras = data.cameras.map(camera => {
    const near = camera.near.map(vector), far = camera.far.map(vector), points = [];
    near.concat(far).forEach(include);
    far.forEach((corner, i) => points.push(near[i], corner, corner, far[(i + 1) % 4]));
    const lines = new THREE.LineSegments(new THREE.BufferGeometry().setFromPoints(points),
      new THREE.LineBasicMaterial());
    scene.add(lines);
    if (camera.picture) {
      const texture = loaded(camera.picture), plane = new THREE.BufferGeometry();
      texture.generateMipmaps = false;
      texture.minFilter = THREE.LinearFilter;
      plane.setFromPoints(far);
      plane.setAttribute('uv', new THREE.BufferAttribute(new Float32Array([0, 0, 1, 0, 1, 1, 0, 1]), 2));
      plane.setIndex([0, 1, 2, 0, 2, 3]);
      scene.add(new THREE.Mesh(plane, new THREE.MeshBasicMaterial({map: texture, transparent: true, opacity: 0.6,
        side: THREE.DoubleSide, depthWrite: false})));
    }
    const tag = view.appendChild(document.createElement('span'));
    tag.classList.toggle('other', camera.standsOut);
    tag.textContent = camera.label;
    const centre = near.reduce((sum, corner) => sum.addScaledVector(corner, 0.25), new THREE.Vector3());
    return {...camera, lines, tag, centre};
  });
  view.classList.toggle('many', cameras.length > 16);

  let isAsked = false;
  const draw = () => {
    if (isAsked) return;
    isAsked = true;
    requestAnimationFrame(() => {
      isAsked = false;
      const distance = eye.position.distanceTo(pivot);
      eye.near = Math.max(distance - 1.1 * reach, distance / 200);
      eye.far = distance + 1.1 * reach;
      eye.updateProjectionMatrix();
      eye.updateMatrixWorld();
      light.position.copy(eye.position);
      renderer.render(scene, eye);
      for (const camera of cameras) {
        const place = camera.centre.clone().project(eye);
        camera.seen = Math.abs(place.z) < 1;
        camera.tag.hidden = !camera.seen;
        camera.left = (place.x + 1) / 2 * view.clientWidth;
        camera.top = (1 - place.y) / 2 * view.clientHeight;
        camera.tag.style.transform = `translate(${camera.left}px, ${camera.top}px)`;
        camera.tag.classList.toggle('right', place.x > 0);
      }
    });
  };
  const fit = () => {
    renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    renderer.setSize(view.clientWidth, view.clientHeight, false);
    eye.aspect = view.clientWidth / view.clientHeight;
    const [across, upwards] = data.start.tangents;
    eye.fov = 2 * Math.atan(Math.max(upwards, across / eye.aspect)) * 180 / Math.PI;
    draw();
  };
  const color = () => {
    for (const camera of cameras) {
      const name = camera.standsOut ? '--other' : '--camera';
      camera.lines.material.color.set(getComputedStyle(model).getPropertyValue(name).trim());
    }
    draw();
  };
  const reset = () => { start.decompose(eye.position, eye.quaternion, eye.scale); draw(); };
  const turned = (axis, angle) => {
    const turn = new THREE.Quaternion().setFromAxisAngle(axis, angle);
    eye.position.sub(pivot).applyQuaternion(turn).add(pivot);
    eye.quaternion.premultiply(turn);
  };
  const turn = (across, down) => {
    turned(up, -across);
    const right = new THREE.Vector3(1, 0, 0).applyQuaternion(eye.quaternion);
    const height = () => new THREE.Vector3(0, 0, 1).applyQuaternion(eye.quaternion).dot(up);
    const before = Math.abs(height());
    turned(right, -down);
    if (Math.abs(height()) > Math.max(before, 0.99)) turned(right, down);
    draw();
  };
  const zoom = factor => {
    const offset = eye.position.clone().sub(pivot);
    offset.setLength(Math.min(Math.max(offset.length() * factor, farthest / 20000), farthest));
    eye.position.copy(pivot).add(offset);
    draw();
  };
  const point = event => {
    const distance = camera => Math.hypot(camera.left - event.offsetX, camera.top - event.offsetY);
    const near = cameras.filter(camera => camera.seen && distance(camera) < 20)
      .sort((a, b) => distance(a) - distance(b))[0];
    for (const camera of cameras) {
      camera.tag.classList.toggle('near', camera === near);
      camera.tag.textContent = camera === near ? camera.name : camera.label;
    }
  };

  const fingers = new Map();
  const spread = () => {
    const [a, b] = fingers.values();
    return Math.hypot(a.x - b.x, a.y - b.y);
  };
  canvas.onpointerdown = event => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, {x: event.clientX, y: event.clientY});
    point(event);
  };
  canvas.onpointermove = event => {
    const last = fingers.get(event.pointerId);
    if (!last) return point(event);
    const before = fingers.size === 2 ? spread() : 0;
    const next = {x: event.clientX, y: event.clientY};
    fingers.set(event.pointerId, next);
    if (fingers.size === 1) turn((next.x - last.x) / 150, (next.y - last.y) / 150);
    if (fingers.size === 2) zoom(before / Math.max(spread(), 1));
  };
  canvas.onpointerup = canvas.onpointercancel = event => fingers.delete(event.pointerId);
  canvas.addEventListener('wheel', event => {
    event.preventDefault();
    zoom(event.deltaY > 0 ? 1.1 : 1 / 1.1);
  }, {passive: false});
  canvas.onkeydown = event => {
    const actions = {ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, -0.1),
      ArrowDown: () => turn(0, 0.1), '+': () => zoom(1 / 1.1), '=': () => zoom(1 / 1.1), '-': () => zoom(1.1)};
    const action = actions[event.key];
    if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    action();
  };
  canvas.addEventListener('webglcontextrestored', draw);
  model.querySelector('button').onclick = reset;
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', color);
  new ResizeObserver(fit).observe(view);
  reset();
  color();
}
</script>
)js";
}

}  // namespace dpr::cli
