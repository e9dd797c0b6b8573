// Bundles the page and writes it as a C++ source file: node build.mjs <page_assets.cpp>
import {readFileSync, writeFileSync} from 'node:fs';
import {dirname, join} from 'node:path';
import {fileURLToPath} from 'node:url';
import {build} from 'esbuild';

const here = dirname(fileURLToPath(import.meta.url));
const target = process.argv[2];
if (!target) throw new Error('usage: node build.mjs <page_assets.cpp>');

async function bundle(entry) {
  const result = await build({
    entryPoints: [join(here, 'src', entry)],
    bundle: true,
    minify: true,
    write: false,
    format: 'iife',
    target: ['chrome100', 'firefox113', 'safari16.4'],
    legalComments: 'inline',
    logLevel: 'warning',
  });
  return result.outputFiles[0].text;
}

const script = await bundle('main.ts');
const style = await bundle('style.css');
if (/<\/script/i.test(script) || /<\/style/i.test(style)) throw new Error('unsafe inside HTML');
const html = readFileSync(join(here, 'src', 'page.html'), 'utf8');
const pieces = html.split(/<!--(?:parts|index|script)-->/);
if (pieces.length !== 4) throw new Error('page.html must have the places parts, index, script');
const [head, middle, afterIndex, end] = pieces;

// Raw string literals of moderate length, one after another.
function literal(text) {
  const chunks = text.match(/[\s\S]{1,8000}/gu) ?? [''];
  return chunks.map((chunk) => `R"~page~(${chunk})~page~"`).join('\n');
}

writeFileSync(target, `// Made by web/build.mjs.
#include "pencilscan/page/page_assets.h"

namespace pencilscan {

PageAssets page_assets() {
  static constexpr char kHead[] = ${literal(head.replace('/*style*/', () => style))};
  static constexpr char kMiddle[] = ${literal(middle)};
  static constexpr char kTail[] = ${literal(`${afterIndex}${script}${end}`)};
  return {{kHead, sizeof kHead - 1}, {kMiddle, sizeof kMiddle - 1}, {kTail, sizeof kTail - 1}};
}

}  // namespace pencilscan
`);
