// Plays a .glb in three.js in a real Chromium and prints what it found as JSON:
//   node play_gltf.cjs FILE CHROMIUM TIME...
const { createServer } = require("http");
const { readFile } = require("fs/promises");
const { extname, join, normalize } = require("path");
const { chromium } = require("playwright-core");

const [file, executablePath, ...times] = process.argv.slice(2);
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".glb": "model/gltf-binary" };
const FLAGS = [
  "--no-sandbox",
  "--disable-gpu",
  "--disable-background-networking",
  "--use-gl=angle",
  "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader",
];

const server = createServer(async (request, response) => {
  const path = normalize(new URL(request.url, "http://localhost").pathname);
  try {
    const data = await readFile(path === "/head.glb" ? file : join(__dirname, path));
    response.writeHead(200, { "Content-Type": TYPES[extname(path)] ?? "text/plain" }).end(data);
  } catch {
    response.writeHead(404).end();
  }
});

async function play(address) {
  const browser = await chromium.launch({ executablePath, args: FLAGS });
  try {
    const page = await browser.newPage();
    const complaints = [];
    page.on("pageerror", (error) => complaints.push(String(error)));
    page.on("console", (message) => {
      const harmless = message.text().includes("GPU stall due to ReadPixels");
      if (["error", "warning"].includes(message.type()) && !harmless) {
        complaints.push(message.text());
      }
    });
    await page.goto(`${address}/play_gltf.html`);
    const report = await page.evaluate(() => window.load());
    report.frames = [];
    for (const time of times) {
      report.frames.push(await page.evaluate((t) => window.at(t), Number(time)));
    }
    report.looks = await page.evaluate(() => window.looks());
    return { ...report, complaints };
  } finally {
    await browser.close();
  }
}

server.listen(0, "127.0.0.1", async () => {
  try {
    const report = await play(`http://127.0.0.1:${server.address().port}`);
    process.stdout.write(JSON.stringify(report));
  } catch (error) {
    console.error(error);
    process.exitCode = 1;
  } finally {
    server.close();
  }
});
