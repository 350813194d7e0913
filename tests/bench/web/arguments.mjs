// SPDX-License-Identifier: LGPL-2.1-or-later
// Arguments of the programs here, each with a comment that begins with "usage: ". Import modules that need a build only after this.
import fs from 'node:fs';
import path from 'node:path';
import { parseArgs } from 'node:util';

// Prints the usage and ends: with 0, or with 2 after a reason.
const printUsage = (reason) => {
  const [, usage] = /^\/\/ (usage: .*)$/m.exec (fs.readFileSync (process.argv[1], 'utf8'));
  if (reason)
    console.error (`${path.basename (process.argv[1])}: ${reason}`);
  (reason ? console.error : console.log) (usage);
  process.exit (reason ? 2 : 0);
};

export const expect = (right, reason) => right || printUsage (reason);

// options: as of parseArgs (). Returns { values, positionals }
export const readArguments = (options, allowPositionals = false) => {
  try {
    const read = parseArgs ({ options: { ...options, help: { type: 'boolean', short: 'h' } }, allowPositionals });
    if (read.values.help)
      printUsage ();
    return read;
  } catch (error) {
    return printUsage (error.message);
  }
};
