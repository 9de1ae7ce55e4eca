// Answers by ganja.js, whose functions are named as they are there: one question a line.
'use strict';

const path = require('path');
const readline = require('readline');
const Algebra = require(path.join(process.env.HAMOTOR_PEERS_NODE, 'ganja.js'));

const algebras = new Map();

// The algebra of these squares, zeros first and negative ones last, and the bit mask of each blade.
function algebra(metric) {
  const squares = metric.map((row, i) => row[i]);
  const key = squares.join();
  if (!algebras.has(key)) {
    const count = (x) => squares.filter((y) => y === x).length;
    const made = Algebra({ p: count(1), q: count(-1), r: count(0), baseType: Float64Array });
    const first = count(0) ? 0 : 1;
    const masks = made.describe().basis.map((name) =>
      name === '1' ? 0 : [...name.slice(1)].reduce((mask, digit) => mask | (1 << (digit - first)), 0));
    algebras.set(key, { made, masks });
  }
  return algebras.get(key);
}

function answer({ metric, operation, operands }) {
  const { made, masks } = algebra(metric);
  const values = operands.map((x) => made.Element(...masks.map((mask) => x[mask])));
  const [first, ...rest] = values;
  let result;
  if (typeof made[operation] === 'function') result = made[operation](...values);
  else if (typeof first[operation] === 'function') result = first[operation](...rest);
  else result = first[operation]; // a getter, as Reverse
  const found = new Array(masks.length).fill(0);
  masks.forEach((mask, i) => { found[mask] = result[i]; });
  return found;
}

console.log = console.error; // what the library prints
console.info = console.error;
readline.createInterface({ input: process.stdin }).on('line', (line) => {
  let said;
  try {
    said = { value: answer(JSON.parse(line)) };
  } catch (error) {
    said = { error: String(error) };
  }
  process.stdout.write(`${JSON.stringify(said)}\n`);
});
