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
