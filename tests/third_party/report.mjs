// Result of a validator: one line on standard output, preceded by the problems; exit code 1 if there are any.

/** Prints the result and exits: `figures` if there are no problems. */
export function finish(name, figures, problems) {
    for (const problem of problems) console.log(`  ${name}: ${problem}`);
    console.log(`${name}: ${problems.length ? `FAILED, ${problems.length} problems` : figures}`);
    process.exit(problems.length ? 1 : 0);
}
