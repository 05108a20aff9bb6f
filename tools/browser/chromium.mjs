// A browser without a screen, and pages whose complaints are kept.

import { chromium } from "playwright-core";

const FLAGS = [
  "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
  "--disable-background-networking", "--disable-component-update", "--disable-sync",
];

/** Starts the system's chromium; the variable CHROMIUM names another one. */
export const launch = () =>
  chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: FLAGS });

/** A page, and the list to which errors on its console and in its program are added. */
export async function open(browser) {
  const page = await browser.newPage({ viewport: { width: 960, height: 640 } });
  const complaints = [];
  page.on("console", (message) => {
    // Reading pixels back waits for the renderer, which a driver may remark on.
    const isRemark = message.text().includes("GPU stall due to ReadPixels");
    if (["error", "warning"].includes(message.type()) && !isRemark) complaints.push(message.text());
  });
  page.on("pageerror", (error) => complaints.push(error.stack ?? error.message));
  // Nothing may come from outside: a page must work where there is no network.
  await page.route(/^https?:\/\/(?!127\.0\.0\.1)/, (route) => {
    complaints.push(`asked for ${route.request().url()}`);
    return route.abort();
  });
  return { page, complaints };
}
