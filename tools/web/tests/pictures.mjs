// Pictures as numbers, by the browser's own decoder.

/** Red, green, blue and opacity of each pixel of a PNG file. */
export async function decodedOn(context, png) {
  const page = await context.newPage();
  const pixels = await page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }), { colorSpaceConversion: "none" });
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const drawn = canvas.getContext("2d");
    drawn.drawImage(bitmap, 0, 0);
    return Array.from(drawn.getImageData(0, 0, bitmap.width, bitmap.height).data);
  }, png.toString("base64"));
  await page.close();
  return pixels;
}

/** Largest and mean difference of a channel, and the share of pixels that differ by more than two of 255. */
export function difference(pixels, reference) {
  if (pixels.length !== reference.length) throw new Error("pictures differ in size");
  let [largest, sum, far] = [0, 0, 0];
  for (let at = 0; at < pixels.length; at += 4) {
    const channels = [0, 1, 2].map((c) => Math.abs(pixels[at + c] - reference[at + c]));
    largest = Math.max(largest, ...channels);
    sum += channels[0] + channels[1] + channels[2];
    far += Math.max(...channels) > 2 ? 1 : 0;
  }
  return { largest, mean: sum / (pixels.length * 0.75), far: far / (pixels.length / 4) };
}
